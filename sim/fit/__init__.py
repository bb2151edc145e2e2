"""A real car's parameters, for the simulator. Read `drive`, `steering`, `driving`, `sensor`, `estimate`, `command`."""
