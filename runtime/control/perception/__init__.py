"""Perception of one scan: points, odometry, the lidar's window, the car's own parts."""
