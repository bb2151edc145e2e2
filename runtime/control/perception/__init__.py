"""One scan understood: points, odometry, the lidar's window, the car's own parts."""
