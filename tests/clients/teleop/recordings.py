"""Event lists as SDL on Linux gives them for a Logitech F710 in both positions of its switch."""

from wallride.clients.teleop.pads import Axis, Button, Event, Hat

X_GUID = "030000006d0400001fc2000005030000"
D_GUID = "030000006d04000019c2000011010000"

# The lines of SDL 2.32's own database.
X_SDL = (
    "030000006d0400001fc2000005030000,Logitech F710 Gamepad (XInput),a:b0,b:b1,back:b6,dpdown:h0.4,dpleft:h0.8,"
    "dpright:h0.2,dpup:h0.1,guide:b8,leftshoulder:b4,leftstick:b9,lefttrigger:a2,leftx:a0,lefty:a1,rightshoulder:b5,"
    "rightstick:b10,righttrigger:a5,rightx:a3,righty:a4,start:b7,x:b2,y:b3,platform:Linux"
)
D_SDL = (
    "030000006d04000019c2000011010000,Logitech F710 Gamepad (DInput),a:b1,b:b2,back:b8,dpdown:h0.4,dpleft:h0.8,"
    "dpright:h0.2,dpup:h0.1,leftshoulder:b4,leftstick:b10,lefttrigger:b6,leftx:a0,lefty:a1,rightshoulder:b5,"
    "rightstick:b11,righttrigger:b7,rightx:a2,righty:a3,start:b9,x:b0,y:b3,platform:Linux"
)

X_REST = (0.0, 0.0, -1.0, 0.0, 0.0, -1.0)
D_REST = (0.0, 0.0, 0.0, 0.0)

# LB down, left stick half forward, right stick full left; (what is read then) speed 0.5, steering 1.
X_DRIVE: list[Event] = [Button(4, True), Axis(1, -0.12), Axis(1, -0.5), Axis(3, -0.3), Axis(3, -1.0)]
D_DRIVE: list[Event] = [Button(4, True), Axis(1, -0.13), Axis(1, -0.5), Axis(2, -0.25), Axis(2, -1.0)]

# MODE is on: the left stick moves the hat.
MODE_ON: list[Event] = [Hat(0, 0, 1), Hat(0, 0, 0), Hat(0, 0, -1), Hat(0, 0, 0), Hat(0, 0, 1), Hat(0, 0, 0)]
# MODE is on: the D-pad moves the stick's axis from end to end.
ON_OFF: list[Event] = [Axis(1, -1.0), Axis(1, 0.0), Axis(1, 1.0), Axis(1, 0.0), Axis(1, -1.0), Axis(1, 0.0)]
