"""The laws that drive and stop the car: pure functions and small state, readable by a student.

No event loop, clock, log or I/O, so that the same code runs on the car, in virtual time and in sweeps of
thousands of steps a second. Read `guidance` (what a law answers), `report` (the lab's own laws), then the defaults:
`perception`, `wall`, `ball` and `speed_profile` for following, `stopping`, `swept` and `recovery` for safety; `methods`
chooses between them, `limiter` has the last word.
"""
