"""Several cars at once: the routers between them and their viewers, the list of the cars, STOP for all of them."""
