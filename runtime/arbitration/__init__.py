"""Which command the motor gets: commands, the command queue, the permit, the emergency stop."""
