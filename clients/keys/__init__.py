"""`wallride keys`: a small certificate authority for one car, and the access list of its operators."""
