"""Parameters of a car, estimated from what it did, by pure functions; the driving car imports none of them."""
