"""Drives in virtual time: the closed loop, devices in memory."""
