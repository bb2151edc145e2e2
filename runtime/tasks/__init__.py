"""Thin loops: wait, ask `control`, speak. None imports another; they meet in `runtime.app`."""
