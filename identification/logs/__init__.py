"""A file becomes a checked Log: formats, the mapping of columns and units, the checks, and what the encoders are."""
