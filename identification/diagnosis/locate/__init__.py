"""Where a model fails: in which row or path, when, and against what."""
