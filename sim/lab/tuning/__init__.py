"""Drives by which settings are tuned: courses under sampled conditions, and the cost of each."""
