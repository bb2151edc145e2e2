"""Recordings, driven once more: ours decision by decision, those of others by our laws, and both onto the air.

Read in this order: `drive_log` (what a recording of ours holds), `stage` (the control code on a clock of its own),
`reenact` and `difference` (the same decisions again, or the first that is not), `foreign` (another program's drive),
`player` and `publish` (onto zenoh, with pause and scrub).
"""
