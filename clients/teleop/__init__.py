"""`wallride teleop`, the operator's client. Read `inputs`, `pilot`, `advice`, `sources`, `screen`, `app`."""
