"""`wallride lab races`: laps on the maps of courses. Read: `mapped_lap`, `race_cell`, `race_table`, `command`."""
