"""`wallride sim`: a drive in real time over emulated devices."""
