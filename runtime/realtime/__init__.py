"""When things run: the phase of the scans, periodic calls, garbage, CPU latency, stage timing."""
