"""`wallride keys`: a small certificate authority for one car, and the list of who may do what with it."""
