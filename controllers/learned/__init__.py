"""Learned policies as plain numbers: their file, their layers, and how they are played like any controller."""
