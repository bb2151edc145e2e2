"""A gamepad on the car's own computer: Linux's input devices (evdev), read in the car's process.

`evdev` gives events their meaning and `car_joystick` decides; only `devices` touches /dev/input. The pilot, the layouts
and the rules of the deadman are those of `wallride.clients.teleop`: the car's desk sees one more client, without a
network.
"""
