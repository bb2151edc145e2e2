"""Simulated hardware: worlds, vehicle, lidar beams, device emulators, and their drivers.

Read in this order: `world` (walls, beams, obstacles), `car` (the physics), `devices` (the real bytes), `live`
(`wallride sim`: one drive of the unmodified runtime), `virtual` (drives without real seconds), `lab` (experiments).
"""
