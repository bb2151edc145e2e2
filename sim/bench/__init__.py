"""Benchmarks of the unmodified `wallride run` process from outside: emulated devices here, the car there, one clock.

Read in this order: `course` (which scans), `devices` (the two ports), `rig` (a process between them), `answers` (which
command answers which scan), `cost` (CPU, memory, threads), then one module per measurement.
"""
