"""One module for each view; each has a function `show(frame)` that draws it."""
