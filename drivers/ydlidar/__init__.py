"""YDLIDAR (X2, X4, X4 Pro, and the G and TG families) over a serial port.

Read in this order: `settings`, `models` (what the models differ in), `codec` (commands, identity, scan packets),
`driver` (start, stop). What it shares with other turning lidars is in `drivers/turning`.
"""
