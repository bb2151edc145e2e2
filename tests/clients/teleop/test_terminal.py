"""A real pseudo-terminal: keys without Enter, kitty's protocol when the terminal answers, everything put back."""

import contextlib
import os
import signal
import sys
import threading
import time

import pytest

from wallride.clients.teleop import key_bytes
from wallride.clients.teleop.advice import Advice, AdviceLevel
from wallride.clients.teleop.keyboard import Act, Key, Quit, TerminalAnswer
from wallride.clients.teleop.screen import Screen
from wallride.clients.teleop.terminal import Terminal, is_there

termios = pytest.importorskip("termios")


class Emulator:
    """The other end: answers kitty's question if it knows it, and keeps what it was sent."""

    def __init__(self, answer=b""):
        self.master, self.slave = os.openpty()
        self.got = b""
        self._answer = answer
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                chunk = os.read(self.master, 4096)
            except OSError:
                return
            self.got += chunk
            for _ in range(chunk.count(key_bytes.ASK)):
                os.write(self.master, self._answer)


@pytest.fixture
def plugged(monkeypatch):
    opened = []

    def plug(emulator):
        for name, mode in (("stdin", "r"), ("stdout", "w")):
            file = os.fdopen(os.dup(emulator.slave), mode)
            opened.append(file)
            monkeypatch.setattr(sys, name, file)
        return emulator

    yield plug
    for file in opened:
        file.close()


def eventually(poll, wanted):
    give_up_s, events = time.monotonic() + 5, []
    while wanted not in events and time.monotonic() < give_up_s:
        events += poll()
        time.sleep(0.002)
    assert wanted in events
    return events


def test_a_terminal_without_kittys_protocol_gives_keys_at_once_and_is_put_back(plugged):
    emulator = plugged(Emulator())
    before = termios.tcgetattr(emulator.slave)
    assert is_there()
    with Terminal(time.monotonic, want_releases=True) as terminal:
        assert not terminal.releases
        os.write(emulator.master, b"w")
        eventually(terminal.poll, Key("w", Act.TYPED))
        termios.tcsetattr(emulator.slave, termios.TCSANOW, before)  # as a shell does at Ctrl-Z
        os.kill(os.getpid(), signal.SIGCONT)
        os.write(emulator.master, b"\x1b[A ")
        eventually(terminal.poll, Key("space", Act.TYPED))
    assert termios.tcgetattr(emulator.slave) == before


def test_kittys_protocol_is_used_and_left_where_the_terminal_answers(plugged):
    emulator = plugged(Emulator(answer=b"\x1b[?11u"))
    with Terminal(time.monotonic, want_releases=True) as terminal:
        assert terminal.releases
        os.write(emulator.master, b"\x1b[119;1:3u")
        eventually(terminal.poll, Key("w", Act.RELEASE))
        eventually(terminal.poll, TerminalAnswer(11))
    eventually(lambda: [emulator.got.endswith(key_bytes.LEAVE)], True)
    assert key_bytes.ENTER in emulator.got


def test_a_terminal_that_grants_less_of_kittys_protocol_is_one_without_releases(plugged):
    emulator = plugged(Emulator(answer=b"\x1b[?1u"))
    with Terminal(time.monotonic, want_releases=True) as terminal:
        assert not terminal.releases
    eventually(lambda: [emulator.got.endswith(key_bytes.LEAVE)], True)


def test_a_screen_whose_terminal_is_gone_says_so():
    master, slave = os.openpty()
    out = os.fdopen(slave, "w")
    screen = Screen(out, plain=False)
    advice = Advice(AdviceLevel.MOVING, "DRIVING", "")
    screen.draw(["DRIVING", "speed"], advice)
    os.close(master)
    with pytest.raises(OSError, match="gone"):
        screen.draw(["DRIVING", "speed"], advice)
    screen.close()
    with contextlib.suppress(OSError):
        out.close()


def test_a_terminal_that_is_gone_is_a_wish_to_leave(plugged):
    plugged(Emulator())
    with Terminal(time.monotonic, want_releases=False) as terminal:
        assert terminal.poll() == []
        null = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null, sys.stdin.fileno())
        assert terminal.poll() == [Quit()]
    os.close(null)
