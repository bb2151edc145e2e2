"""Maps of a lap and poses on them, against the truth of the simulator."""
