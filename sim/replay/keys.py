"""Keys of the player: plain bytes of a terminal, and their actions."""

import sys
from collections.abc import Callable, Mapping

from wallride.sim.replay.player import Player

STEP_S, LEAP_S = 5.0, 30.0
SEQUENCES: Mapping[bytes, str] = {
    b"\x1b[C": "right", b"\x1bOC": "right", b"\x1b[D": "left", b"\x1bOD": "left",
    b"\x1b[6~": "page down", b"\x1b[5~": "page up", b"\x1b[H": "home", b"\x1b[1~": "home", b"\x1bOH": "home",
    b" ": "space", b"+": "+", b"=": "+", b"-": "-", b"q": "q", b"\x04": "q",
}  # fmt: skip


def names(typed: bytes) -> list[str]:
    """Return the keys in the typed bytes; unknown ones are left out."""
    found = []
    while typed:
        match = next((sequence for sequence in SEQUENCES if typed.startswith(sequence)), None)
        if match is not None:
            found.append(SEQUENCES[match])
        typed = typed[len(match or b"?") :]
    return found


def press(player: Player, name: str) -> bool:
    """Perform the action of a key; False for the key that quits."""
    match name:
        case "space":
            player.paused = not player.paused
        case "+":
            player.multiply_speed(2.0)
        case "-":
            player.multiply_speed(0.5)
        case "right" | "left":
            player.seek(player.position_s + (STEP_S if name == "right" else -STEP_S))
        case "page down" | "page up":
            player.seek(player.position_s + (LEAP_S if name == "page down" else -LEAP_S))
        case "home":
            player.seek(0.0)
        case "q":
            return False
    return True


def single_keys() -> Callable[[], None] | None:
    """Switch the terminal to single keys without echo; returns a function that restores it, None without a terminal."""
    if sys.platform == "win32" or not sys.stdin.isatty():
        return None
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    return lambda: termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
