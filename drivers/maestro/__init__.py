"""A Pololu Maestro on a serial port, as on RACECAR Neos: servo pulses, with a serial timeout that can stop the car."""
