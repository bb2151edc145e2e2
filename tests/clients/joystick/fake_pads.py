"""Gamepads as Linux describes them (by the kernel's drivers), and one that can be held, moved and pulled."""

import errno

from wallride.clients.joystick.evdev import EV_ABS, EV_KEY, EV_SYN, RECORD, SYN_DROPPED, SYN_REPORT, PadDescription

STICK, BYTE, HAT = (-32768, 32767), (0, 255), (-1, 1)
XPAD_KEYS = (304, 305, 307, 308, 310, 311, 314, 315, 316, 317, 318)
XPAD_RANGES = {0: STICK, 1: STICK, 2: BYTE, 3: STICK, 4: STICK, 5: BYTE, 16: HAT, 17: HAT}
SONY_KEYS = (304, 305, 307, 308, *range(310, 319))
SONY_RANGES = {**dict.fromkeys(range(6), BYTE), 16: HAT, 17: HAT}
F710_X = PadDescription("Logitech Gamepad F710", (3, 0x046D, 0xC21F, 0x0305), XPAD_KEYS, XPAD_RANGES)
F710_D = PadDescription(
    "Logitech Cordless RumblePad 2", (3, 0x046D, 0xC219, 0x0111), range(288, 300),
    {0: BYTE, 1: BYTE, 2: BYTE, 5: BYTE, 16: HAT, 17: HAT},
)  # fmt: skip
XBOX_360 = PadDescription("Microsoft X-Box 360 pad", (3, 0x045E, 0x028E, 0x0110), XPAD_KEYS, XPAD_RANGES)
XBOX_BLUETOOTH = PadDescription(
    "Xbox Wireless Controller", (5, 0x045E, 0x02FD, 0x0903), range(304, 319),
    {0: (0, 65535), 1: (0, 65535), 2: (0, 65535), 5: (0, 65535), 9: (0, 1023), 10: (0, 1023), 16: HAT, 17: HAT},
)  # fmt: skip
PS4 = PadDescription("Wireless Controller", (5, 0x054C, 0x09CC, 0x8100), SONY_KEYS, SONY_RANGES)
PS5 = PadDescription("DualSense Wireless Controller", (3, 0x054C, 0x0CE6, 0x8111), SONY_KEYS, SONY_RANGES)
PS4_WITHOUT_DRIVER = PadDescription("Wireless Controller", (3, 0x054C, 0x09CC, 0x0111), range(304, 318), SONY_RANGES)
PS4_GYRO = PadDescription("Wireless Controller Motion Sensors", (5, 0x054C, 0x09CC, 0x8100), (), {0: STICK, 1: STICK})
KEYBOARD = PadDescription("USB Keyboard", (3, 0x04D9, 0x1603, 0x0110), range(1, 120), {})

LB, RB, B, START, Y = 310, 311, 305, 315, 308
LEFT_Y, RIGHT_X = 1, 3


class FakePad:
    """A pad of xpad's kind whose records are those that a kernel would give."""

    def __init__(self, description=F710_X):
        self.description = description
        self.values = {(EV_KEY, code): 0 for code in description.keys}
        for code, (low, high) in description.ranges.items():
            triggers = (2, 5) if description is F710_X else ()
            self.values[EV_ABS, code] = 0 if low < 0 or code in triggers else (high + 1) // 2
        self.records = []
        self.pulled = self.closed = False

    def set(self, kind, code, number, *, seen=True):
        """Change a control; not seen: the kernel had no room for the record."""
        self.values[kind, code] = number
        if seen:
            self.record(kind, code, number)
            self.record(EV_SYN, SYN_REPORT, 0)

    def hold(self, *codes):
        """Hold these buttons and no others."""
        for code in self.description.keys:
            if self.values[EV_KEY, code] != int(code in codes):
                self.set(EV_KEY, code, int(code in codes))

    def push(self, share, axis=LEFT_Y):
        """Push a stick, by way of its middle position, as a hand does: 1 is up or left to its end."""
        low, high = self.description.ranges[axis]
        for part in (share / 2, share):
            self.set(EV_ABS, axis, round((low + high) / 2 - part * (high - low) / 2))

    def jitter(self):
        """Move the axis that nothing is bound to a little, as a pad in a hand does."""
        axis = max(code for code in self.description.ranges if code < 16)
        self.set(EV_ABS, axis, self.values[EV_ABS, axis] ^ 64)

    def overflow(self):
        """Let the kernel say that records were lost."""
        self.record(EV_SYN, SYN_DROPPED, 0)
        self.record(EV_KEY, B, 1)  # what comes before the report is of no use
        self.record(EV_SYN, SYN_REPORT, 0)

    def record(self, kind, code, number):
        """Add one record."""
        self.records.append(RECORD.pack(1, 2, kind, code, number))

    def read(self):
        if self.pulled:
            raise OSError(errno.ENODEV, "No such device")
        data, self.records = b"".join(self.records), []
        return data

    def state(self):
        if self.pulled:
            raise OSError(errno.ENODEV, "No such device")
        return [(kind, code, number) for (kind, code), number in self.values.items()]

    def close(self):
        self.closed = True
