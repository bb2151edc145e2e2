"""The follower `line`: drives a race line by the pose on a map. Pure, without a clock.

Read in this order: `race_line` (what is driven), `tyres` (how axles slip), `line_law` (steering by line and pose),
`joining` (the way to the line), `promising` (what safety may judge), `lap_memory` (laps, errors, and how fast the next
one may be), `course` (map, pose and line of a car), `line_follower` (what is made of it all).
"""
