"""Which lidar is at hand: told by the protocol that it answers in, never by its name or USB id.

Read in this order: `settings`, `ports` (where to look), `identify` (who answers there).
"""
