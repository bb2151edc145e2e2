"""Thin loops: wait, call `control`, put the answer. None imports another; they meet in `wallride.runtime.app`."""
