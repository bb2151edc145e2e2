"""Paired comparison of two sweeps."""
