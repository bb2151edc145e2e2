"""The laws that drive and stop the car: pure functions and small state, readable by a student.

No event loop, clock, log or I/O, so that the same code runs on the car, in virtual time and in sweeps of
thousands of steps a second. Read `guidance` (the interfaces), `report` (the lab's own laws), then the defaults:
`perception`, `wall_following` (`ball`, `speed_profile`), `safety` (`stopping`, `swept`) and `recovery`; `methods`
selects between them, `limiter` clamps the result.
"""
