"""Figures: they draw what the other rooms produce, and compute nothing."""
