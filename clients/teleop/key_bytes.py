"""Decoder of a terminal's key bytes: plain bytes, the arrows' sequences, kitty's keyboard protocol. Pure.

kitty's protocol (sw.kovidgoyal.net/kitty/keyboard-protocol): CSI code ; modifiers : act u, with act 1 press, 2 repeat,
3 release. We ask for flags 1 + 2 + 8: unambiguous, with releases, for every key, Shift included.
"""

import re

from wallride.clients.teleop.keyboard import Act, Key, KeyEvent, Quit, TerminalAnswer, TerminalFocus

ASK = b"\x1b[?u"
"""The terminal answers with its flags, if it knows the protocol."""
RELEASES = 2 | 8
"""Flags of a terminal that tells the release of every key; some know the protocol and grant less."""
ENTER = b"\x1b[>11u\x1b[?1004h"
LEAVE = b"\x1b[?1004l\x1b[<u"
LONE_ESCAPE_S = 0.1
"""Time without a further byte after which an escape byte counts as the key, also with the begin of a sequence."""

SEQUENCE = re.compile(
    rb"\x1b\[(?P<mark>[<=>?[]?)(?P<numbers>[0-9:;]*)(?P<final>[A-Za-z~$^@])|\x1bO[0-9;]*(?P<letter>[A-Za-z])"
)
UNFINISHED = re.compile(rb"\x1b(\[[<=>?[]?[0-9:;]{0,32}|O[0-9;]{0,8})?")
ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
CODES = {27: "escape", 32: "space", 57441: "shift", 57447: "shift"}
ACTS = {1: Act.PRESS, 2: Act.REPEAT, 3: Act.RELEASE}
CONTROL_BIT = 4
LEAVING = {"c", "d"}
"""Keys that quit with Ctrl held."""


class KeyBytes:
    """Finds keys in a terminal's bytes, whatever the chunking; unknown bytes are left out.

    An escape byte that begins no known sequence is the key, whatever comes after it: it is the e-stop.
    """

    def __init__(self) -> None:
        self._waiting = b""
        self._since_s = 0.0

    def feed(self, chunk: bytes, now_s: float) -> list[KeyEvent]:
        """Add bytes (none is fine) and return the events they completed."""
        if chunk:
            self._waiting += chunk
            self._since_s = now_s
        events: list[KeyEvent] = []
        while self._waiting:
            match = SEQUENCE.match(self._waiting)
            if match is not None:
                self._waiting = self._waiting[match.end() :]
                events += _sequence(match)
            elif UNFINISHED.fullmatch(self._waiting):
                if now_s - self._since_s >= LONE_ESCAPE_S:
                    self._waiting = b""
                    events += _plain(b"\x1b")
                break
            else:
                byte, self._waiting = self._waiting[:1], self._waiting[1:]
                events += _plain(byte)
        return events


def _plain(byte: bytes) -> list[KeyEvent]:
    if byte == b"\x1b":
        return [Key("escape", Act.TYPED)]
    if byte in {b"\x03", b"\x04"}:
        return [Quit()]
    if byte == b" ":
        return [Key("space", Act.TYPED)]
    return [Key(byte.decode().lower(), Act.TYPED)] if byte.isalpha() else []


def _sequence(match: re.Match[bytes]) -> list[KeyEvent]:
    if match["letter"] is not None:
        letter = match["letter"].decode()
        return [Key(ARROWS[letter], Act.TYPED)] if letter in ARROWS else []
    final, numbers = match["final"].decode(), match["numbers"].decode()
    if match["mark"]:
        return [TerminalAnswer(_int(numbers, 0))] if (match["mark"], final) == (b"?", "u") else []
    fields = [field.split(":") for field in numbers.split(";")]
    modifiers = _int(fields[1][0], 1) - 1 if len(fields) > 1 else 0
    act = ACTS.get(_int(fields[1][1], 1) if len(fields) > 1 and len(fields[1]) > 1 else 1, Act.PRESS)
    if final in ARROWS:
        return [Key(ARROWS[final], act)]
    if final in {"I", "O"} and not numbers:
        return [TerminalFocus(gained=final == "I")]
    if final != "u":
        return []
    code = _int(fields[0][0], 0)
    name = CODES.get(code) or (chr(code).lower() if code < 128 and chr(code).isalpha() else "")
    if name in LEAVING and modifiers & CONTROL_BIT:
        return [Quit()] if act is not Act.RELEASE else []
    return [Key(name, act)] if name else []


def _int(text: str, default: int) -> int:
    return int(text) if text else default
