"""Bytes on one side, SI values on the other; knows nothing about driving.

Read in this order: `api` (what a lidar and a motor are), `link` (bytes to and from a port), then a device,
each with the same three files: `settings`, `codec` (pure), `driver` (thin).
"""
