"""Off-car programs, run on a laptop to watch and to operate a car.

They know the car only by its messages: `wallride.runtime.wire` (topics, teleop, the bus that carries them) and
`wallride.runtime.ros`.
"""

CONNECT_VARIABLE = "WALLRIDE_CONNECT"
"""Environment variable: where clients connect to that are told no endpoint."""
DEFAULT_CONNECT = "tcp/127.0.0.1:7447"
DEFAULT_KEYS = "~/.config/wallride/keys"
HIGHEST_PORT = 65535
