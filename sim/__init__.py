"""Simulated hardware and its drivers. Read `world`, `car`, `devices`, `live` (`wallride sim`), `virtual`, `lab`."""
