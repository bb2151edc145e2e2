"""Obstacles that one view does not show: moving ones, thin ones, and those behind the lidar's field."""
