"""Find where a model and data disagree, name the missing effect, add it, and show the gap shrink."""
