"""`wallride lab races`: laps on the maps of courses.

Read in this order: `mapped_lap` (the map of a course), `race_cell` (one race), `boxes` (what may stand in its way),
`race_table`, `command`.
"""
