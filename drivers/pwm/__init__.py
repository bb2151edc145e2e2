"""What motors by servo pulses share: a steering servo and a hobby ESC behind a board that makes pulses.

Such a car has no tachometer. Its speed is told by the scans (`speed`), or not at all. Read in this order: `settings`,
`speed`, `throttle` (what an ESC makes of a pulse), `speed_loop` (which speed to ask for), `driver` (the connection).
"""
