"""Timing: the phase of the scans, periodic calls, garbage collection, CPU latency, stage timing."""
