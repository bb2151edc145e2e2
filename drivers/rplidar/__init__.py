"""Slamtec RPLIDAR (A1, A2, A3, S1, S2, S3, C1) over a serial port.

Read in this order: `settings`, `codec` (commands, identity, plain samples), `capsules` and `capsule_formats` (the
compressed streams), `models` (what the models differ in), `driver` (start, stop). What it shares with other turning
lidars is in `drivers/turning`.
"""
