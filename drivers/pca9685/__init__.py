"""A PCA9685 board on I2C, as on donkeycars: 16 outputs of 12 bits, one frequency, no command timeout."""
