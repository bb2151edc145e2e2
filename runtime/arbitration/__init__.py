"""Arbitration of the motor command: commands, the command queue, the permit, the emergency stop."""
