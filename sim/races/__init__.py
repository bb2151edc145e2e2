"""`wallride lab races`: laps on maps of courses. Read `mapped_lap`, `race_cell`, `boxes`, `race_table`, `command`."""
