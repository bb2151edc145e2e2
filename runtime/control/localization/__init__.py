"""Where the car is on a map, at every scan: pure, in numpy alone, without a clock.

Read in this order: `wall_points` (what a map says of its walls), `line_field` (the nearest wall's line for each cell),
`scan_points` (some beams of a scan, as seen in one moment), `wheel_steps` (the way between two scans), `pose_filter`
(one scan laid over the map, and what is learnt of the car's errors), `place_search` (a place of which nothing is
known), `localizer` (what is made of it all). Without a map: `gyro_odometry` (dead reckoning by wheels and gyro) and
`odometry_errors` (what scans teach it).
"""
