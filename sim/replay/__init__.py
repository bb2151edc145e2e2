"""Replay of recordings, decision by decision or over zenoh. Read `drive_log`, `stack`, `reenact`, `foreign`."""
