"""`wallride vesc`: sets what protects the car inside the motor controller, and puts it back."""
