"""A map and the path of the lap, from one recorded drive: offline, on a laptop or on the car.

Read in this order: `lap_record` (what of a recording is needed), `odometry_path` (motion by wheels and gyro),
`keyframes` (de-skewed scans with their surfaces), `pose_graph` (edges between keyframes, and the poses that fit them),
`closing` (from a drive to its poses), `raster` (the grid), `verdict` (whether to trust it), `map_output` (the files).
"""
