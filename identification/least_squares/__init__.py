"""The paper's method: the filtered dynamic model, solved in a batch or recursively."""
