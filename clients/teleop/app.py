"""Operator's client: inputs to the pilot, the pilot's commands to the car, fifty times a second."""

import argparse
import asyncio
import math
import secrets
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack

from wallride.clients.connection import ConnectionProblemError, another_car, connected
from wallride.clients.ending import INTERRUPTED, stopping
from wallride.clients.teleop import gamepad, pad_files, terminal
from wallride.clients.teleop.advice import advise
from wallride.clients.teleop.link_probe import WITHIN_S, LinkProbe
from wallride.clients.teleop.pads import usb_id
from wallride.clients.teleop.pilot import DeadmanFault, Pilot
from wallride.clients.teleop.screen import CarState, Screen, lines
from wallride.clients.teleop.script import ScriptError, load
from wallride.clients.teleop.shaping import InputShape
from wallride.clients.teleop.sources import (
    InputSource,
    KeySource,
    PadOrKeySource,
    PadSource,
    ScriptSource,
    StopKeySource,
    WindowSource,
)
from wallride.clients.teleop.wizard import Wizard
from wallride.runtime.ending import end
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.teleop import Command, Input, Malformed, read_beat

PERIOD_S = 0.02
CYCLES_PER_DRAWING = 3
GOODBYES = 3
KEY_STEERING_RATE_RADPS = 1.5
"""Steering rate of keys, which have no intermediate positions."""

Clock = Callable[[], float]


class TeleopProblemError(Exception):
    """An error that the user can correct; one line with the remedy."""


class Client:
    """One operator at one car.

    probe: measures the link, None where nothing does.
    session: of the selected process of the car, None for the first to answer. foreign: another one's, once it answered.
    malformed: beats that could not be read.
    """

    def __init__(
        self, link: Bus, car: str, pilot: Pilot, source: InputSource, screen: Screen, clock: Clock,
        session: int | None = None,
    ) -> None:  # fmt: skip
        self._link = link
        self._car = car
        self._pilot = pilot
        self._source = source
        self._screen = screen
        self._clock = clock
        self._news = CarState()
        self._kind = Input.PAD
        self._session = session
        self.probe: LinkProbe | None = None
        self.foreign: int | None = None
        self.malformed = 0

    async def run(self, stop: asyncio.Event) -> None:
        """Operate until a stop request or the end of the source; the last messages are a release and a goodbye."""
        self._listen()
        try:
            cycle = 0
            async for now_s in deadlines(PERIOD_S, self._clock):
                self.step(now_s)
                if cycle % CYCLES_PER_DRAWING == 0 and not self.draw():
                    return
                cycle += 1
                if stop.is_set() or self._source.leaving or self.foreign is not None:
                    return
        finally:
            await self._leave()

    def step(self, now_s: float) -> None:
        """Read the inputs, send their command."""
        situation = self._pilot.situation
        # A script may also begin at a car that has another operator or is latched: to take over, to reset.
        ready = situation is not None and (
            situation.armed or situation.block in {DeadmanFault.OTHER, DeadmanFault.LATCHED}
        )
        inputs = self._source.poll(now_s, ready=ready)
        self._kind = inputs.kind
        if self.probe is not None:
            self._pilot.know_link(self.probe.takes_s(now_s), self.probe.patience_s)
        self._send(self._pilot.step(inputs, now_s))

    def draw(self) -> bool:
        """Show the present state; False when the terminal is gone, because driving without a display is not allowed."""
        situation = self._pilot.situation
        if situation is None:
            return True
        advice = advise(situation, self._source.names, by_keys=self._link.is_by_keys)
        rows = lines(self._car, situation, advice, self._news, self._source.names)
        try:
            self._screen.draw(rows, advice)
        except OSError:
            return False
        if self._source.window is not None:
            self._source.window.show(rows, advice.mood.value)
        return True

    def _listen(self) -> None:
        for topic in (topics.STATUS, topics.DECISION):
            self._link.subscribe(topics.key(self._car, topic), lambda _key, payload, _s: self._news.take(payload))
        self._link.subscribe(topics.key(self._car, topics.BEAT), self._on_beat)
        self._link.watch(topics.key(self._car, f"{topics.OPERATOR_ALIVE}/*"), self._news.on_operator)
        self._link.announce(topics.key(self._car, f"{topics.OPERATOR_ALIVE}/{self._pilot.session:016x}"))

    def _on_beat(self, _key: str, payload: bytes, arrival_s: float) -> None:
        try:
            beat = read_beat(payload)
        except Malformed:
            self.malformed += 1
            return
        if self._session in {None, beat.car_session}:
            self._pilot.hear(beat, arrival_s)
        else:
            self.foreign = beat.car_session

    def _send(self, command: Command) -> None:
        if self._pilot.is_addressed(command):
            self._link.put(topics.key(self._car, topics.COMMAND), command.pack(), encoding=BYTES, urgent=True)

    async def _leave(self) -> None:
        for _ in range(GOODBYES):
            self._send(self._pilot.goodbye(self._kind))
            await asyncio.sleep(PERIOD_S)


async def deadlines(period_s: float, clock: Clock) -> AsyncIterator[float]:
    """Yield the time at absolute deadlines; missed ones are skipped, never caught up in a burst."""
    next_s = clock()
    while True:
        now_s = clock()
        yield now_s
        next_s += period_s
        behind_s = clock() - next_s
        if behind_s > 0:
            next_s += period_s * (behind_s // period_s)
        await asyncio.sleep(max(0.0, next_s - clock()))


async def operate(options: argparse.Namespace) -> int:
    """Run `wallride teleop`; options as of `wallride.teleop_options`."""
    if options.map:
        return await map_pad(_write)
    stop = asyncio.Event()
    with stopping(stop), ExitStack() as things:
        source = _open_source(options, things)
        pilot = Pilot(secrets.randbits(63) + 1, options.name, _feel(options))
        async with connected(options, asks=True) as (bus, car):
            screen = Screen(sys.stdout, plain=options.plain or bool(options.script))
            things.callback(screen.close)
            client = Client(bus, car, pilot, source, screen, time.monotonic, options.session)
            key = topics.key(car, f"{topics.PARAM}/get")
            client.probe = LinkProbe(lambda question: bus.ask(key, question, timeout_s=WITHIN_S))
            measuring = asyncio.create_task(client.probe.run(), name="link")
            try:
                await client.run(stop)
            finally:
                await end(measuring)
            if client.foreign is not None:
                raise ConnectionProblemError(another_car(car, bus.endpoint, options.session, client.foreign))
    return 0


def _write(text: str) -> None:
    """Write at once, also into a pipe."""
    sys.stdout.write(text)
    sys.stdout.flush()


async def map_pad(print_line: Callable[[str], object]) -> int:
    """Run the wizard on the first pad that appears, and write its file; INTERRUPTED where it was ended before."""
    stop = asyncio.Event()
    with ExitStack() as things:
        sdl = _open_sdl(things, window=False)
        things.enter_context(stopping(stop))  # after SDL, which takes SIGTERM for an event of its own
        return await _ask(sdl, stop, print_line)


async def _ask(sdl: gamepad.Sdl, stop: asyncio.Event, print_line: Callable[[str], object]) -> int:
    print_line("Plug in the pad and press one of its buttons. Ctrl-C leaves.\n")
    wizard: Wizard | None = None
    pad, asked = -1, ""
    async for now_s in deadlines(PERIOD_S, time.monotonic):
        if stop.is_set():
            break
        for happening in sdl.poll():
            match happening:
                case gamepad.PadConnected(first, guid, name, rest) if wizard is None:
                    print_line(f"{name} ({usb_id(guid)})\n")
                    pad, wizard = first, Wizard(guid, name, rest)
                case gamepad.Gone(gone) if gone == pad:
                    raise TeleopProblemError("the pad was unplugged; start again")
                case gamepad.PadMoved(moved, event) if wizard is not None and moved == pad:
                    wizard.feed(event, now_s)
                case _:
                    pass
        if wizard is None:
            continue
        if wizard.finished:
            print_line(f"written: {pad_files.save(pad_files.folder(), wizard.guid, wizard.toml())}\n")
            return 0
        if asked != (asked := f"{wizard.remark}{': ' if wizard.remark else ''}{wizard.question}\n"):
            print_line(asked)
    return INTERRUPTED


def _open_source(options: argparse.Namespace, things: ExitStack) -> InputSource:
    try:
        if options.script:
            return _with_stop_keys(ScriptSource(load(options.script)), things)
        if options.window:
            return _with_stop_keys(WindowSource(_open_sdl(things, window=True)), things)
        if options.keyboard:
            if not terminal.is_there():
                raise TeleopProblemError("--keyboard needs a terminal; use --window, or a pad")
            return _open_keys(things)
        own, problems = pad_files.read_all(pad_files.folder())
        if problems:
            raise TeleopProblemError("; ".join(problems))
        pads = PadSource(_open_sdl(things, window=False), own, options.pad or "")
        if not terminal.is_there():
            return pads
        return PadOrKeySource(pads, _open_keys(things), KEY_STEERING_RATE_RADPS / options.max_steering)
    except (ScriptError, OSError) as error:
        raise TeleopProblemError(str(error)) from None


def _open_keys(things: ExitStack) -> KeySource:
    keys = things.enter_context(terminal.Terminal(time.monotonic, want_releases=True))
    return KeySource(keys, releases=keys.releases)


def _with_stop_keys(source: InputSource, things: ExitStack) -> InputSource:
    """Add the stop keys of the terminal, if there is one."""
    if not terminal.is_there():
        return source
    return StopKeySource(source, things.enter_context(terminal.Terminal(time.monotonic, want_releases=False)))


def _open_sdl(things: ExitStack, *, window: bool) -> gamepad.Sdl:
    sdl = gamepad.Sdl(window=window)
    things.callback(sdl.close)
    return sdl


def _feel(options: argparse.Namespace) -> InputShape:
    """Return the response of the chosen device; keys and scripts have no stick with a dead zone and a curve."""
    keys = options.keyboard or options.window
    deadzone, expo = (0.0, 0.0) if keys or options.script else (options.deadzone, options.expo)
    rate_radps = KEY_STEERING_RATE_RADPS if keys else math.inf
    return InputShape(options.max_speed, options.max_steering, deadzone, expo, options.ramp, rate_radps)
