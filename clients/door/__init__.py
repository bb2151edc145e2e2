"""How the web servers of wallride let programs in: one check of host, page and token, and bounds on connections."""
