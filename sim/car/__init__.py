"""The simulated car: vehicle, motor control, actuation delay."""
