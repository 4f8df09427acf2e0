"""How well a plant predicts logs that it was not fitted to, and how well any plant could."""
