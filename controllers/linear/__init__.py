"""Linear laws: one kind of data for all of them, and their designs: LQR, LQG, integral action, the paper's gain."""
