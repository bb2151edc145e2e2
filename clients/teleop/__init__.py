"""`wallride teleop`, the operator's client. Modules in the order to read them.

inputs    operator's inputs at this moment, independent of the device
pilot     which presses count and what to send now: the client's half of "release means stop"; pure
shaping   from a stick to a speed and a steering angle: dead zone, expo, ramp, limits; pure
hold      presses that are deliberate: alone, and for one second; pure
advice    present state and next step, in words; pure
pads      a pad's raw axes and buttons to inputs, from SDL's mapping or a file of one's own; pure
mode_button, pad_files, wizard   the F710's MODE button; files for unknown pads; the questions that write one
keyboard  keys to inputs: with real releases, or by the age of repeats; pure
terminal  bytes of a terminal to keys; the terminal itself
gamepad   SDL: pads and the keyboard window; the only importer of pygame
script    inputs from a file, for tests and demonstrations
sources   each of the above as one thing to poll
screen    display for the operator
app       the client, connected to a car, fifty times a second
"""
