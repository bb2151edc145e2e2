"""`wallride doctor`: everything from cable to certificate, each line with its remedy.

Read in this order: `findings` (one line of the answer), `computer` (files and rights of the computer, which tests
replace), then the checks: `ports` and `network` before a device is opened; `lidar`, `motor`, `motor_config`,
`wheels_up` with the device; `condition`, `program`, `access`, `joystick` of the computer. `examine` runs them, `report`
prints them.
"""
