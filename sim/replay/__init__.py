"""Replay of recordings: wallride's own decision by decision, those of others by our laws, and both over zenoh.

Read in this order: `drive_log` (content of our own recordings), `stack` (the control code on a clock of its own),
`reenact` and `difference` (the same decisions again, or the first different one), `foreign` (another program's drive),
`player` and `publish` (onto zenoh, with pause and scrub).
"""
