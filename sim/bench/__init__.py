"""Benchmarks of the unmodified `wallride run`, on one clock. Read `course`, `devices`, `rig`, `answers`, `measure`."""
