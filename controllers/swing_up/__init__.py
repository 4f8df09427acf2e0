"""Swing-ups: by energy or by a plan, and the state predicted over the delay that they catch with."""
