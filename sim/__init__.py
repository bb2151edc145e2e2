"""Simulated hardware: worlds, vehicle, lidar beams, device emulators, and their drivers.

Read in this order: `world` and `vehicle` (the physics), `beams`, `devices` (the real bytes), `session` (one drive of
the unmodified runtime), `command` (`wallride sim`). `twins` and `virtual_time` are for stories without real seconds.
"""
