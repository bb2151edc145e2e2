"""Shared parts of lidars that turn a full circle and send single samples (RPLIDAR, YDLIDAR).

Read in this order: `settings`, `samples` (what a codec returns), `turns` (samples to turns, and their age), `grid` (a
turn to a scan with one angle step), `replies` and `conversation` (request and reply), `driver` (connect, monitor,
reconnect).
"""
