"""Recording of every drive on disk, off the hot path: the decision log, telemetry, and the last half minute."""
