"""The safety law `swept`: footprint, stopping, obstacles, what is remembered."""
