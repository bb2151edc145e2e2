"""`wallride status`: one screen that answers "why is it (not) moving?"."""

import argparse
import asyncio
import json
import math
import shutil
import sys
import textwrap
import time
from collections.abc import Container, Iterator, Mapping
from typing import Any

from wallride.clients.answers import reading
from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.played import NOTHING_DRIVES, PlayedNames
from wallride.clients.refreshing import RefreshedScreen
from wallride.runtime.arbitration.driving_state import DrivingState
from wallride.runtime.host.terminal_text import LONGEST, one_line
from wallride.runtime.telemetry.screen_words import because, steering_words
from wallride.runtime.teleop.status import OperatorState
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

FIRST_WITHIN_S = 3.0
REFRESH_S = 0.2
SILENT_S = 1.0
STANDS_BELOW_MPS = 0.1
RULE_WIDTH = 78
LABEL = 10
"""Width of the names of the rows."""
Status = Mapping[str, Any]
BIND = "wallride param set safety.binds_teleop=true"


async def run(options: argparse.Namespace) -> int:
    """Show the status once, or until interrupted; options as of `wallride.topic_options`."""
    async with connected(options) as (bus, car):
        ear = StatusListener(bus, topics.key(car, topics.STATUS))
        played = PlayedNames(bus, car)
        status = await ear.first(car, played)
        if not options.watch:
            with reading(car, "status"):
                lines = [*told_played(car, played), *screen(status, columns=columns_here())]
            options.print_line(json.dumps(status, indent=2) if options.json else "\n".join(lines))
            return 0
        shown, told = RefreshedScreen(options.print_line), None
        while True:
            silent_s = time.monotonic() - ear.heard_s
            if not options.json:
                with reading(car, "status"):
                    first, lines = told_played(car, played), screen(ear.newest, silent_s, columns_here())
                line = "  ".join([*first, *lines[: 1 if silent_s <= SILENT_S else 2]])
                shown.show("\n".join([*first, *lines]), line)
            elif ear.newest is not told:
                told = ear.newest
                options.print_line(json.dumps(told))
            await asyncio.sleep(REFRESH_S)


class StatusListener:
    """Keeps the newest status of a car. heard_s: its arrival on this machine's monotonic clock."""

    def __init__(self, bus: Bus, key: str) -> None:
        self.newest: Status = {}
        self.heard_s = 0.0
        self._came = asyncio.Event()
        bus.subscribe(key, self._on_status)

    async def first(self, car: str, played: Container[str] = ()) -> Status:
        """Return the first status; ConnectionProblemError when none comes. played: names that are recordings."""
        try:
            async with asyncio.timeout(FIRST_WITHIN_S):
                await self._came.wait()
        except TimeoutError:
            if car in played:
                raise ConnectionProblemError(f"{car}: {NOTHING_DRIVES}; it has no status") from None
            raise ConnectionProblemError(
                f"{car} is there but sends no status: its process hangs or is stopped, see its log;"
                " or telemetry.rates_hz.status is 0 on the car"
            ) from None
        return self.newest

    def _on_status(self, _key: str, payload: bytes, arrival_s: float) -> None:
        try:
            self.newest = topics.decode(payload)
        except (ValueError, TypeError):
            return  # the next one comes in a tenth of a second
        self.heard_s = arrival_s
        self._came.set()


def told_played(car: str, played: Container[str]) -> list[str]:
    """Return the line above the screen of a recording: what follows is of the time of its drive."""
    return [f"{car}: {NOTHING_DRIVES}. What follows is its status of then."] if car in played else []


def lost_device(status: Status) -> str:
    """Return the device that is not ready, and why; "" where both are."""
    closed = status.get("gates") or {}
    return next((f"{device} {closed[device]}" for device in ("motor", "lidar") if closed.get(device)), "")


def headline(status: Status) -> str:
    """Return the answer in one line: what the car does, the deciding source, and the reason."""
    output, measured_mps = status.get("output") or {}, abs(status.get("speed_mps") or 0.0)
    stands = f"brakes at {measured_mps:.2f} m/s" if measured_mps > STANDS_BELOW_MPS else "stands"
    if lost := lost_device(status):
        return f"{stands}: {lost}"
    if not output:
        return f"{stands}: nothing has been decided yet"
    condition = status.get("condition") or {}
    if output["speed_mps"] and condition.get("state") == DrivingState.STOPPED:  # too slow for the motor, for example
        return f"{stands}: {because(condition['reason'], condition.get('measure'))}"
    does = f"drives {output['speed_mps']:.2f} m/s" if output["speed_mps"] else stands
    return f"{does}: {output['winner']}: {because(output['reason'], output.get('measure'))}"


def screen(status: Status, silent_s: float = 0.0, columns: int = LONGEST) -> list[str]:
    """Return the screen. silent_s: time since the last message. columns: of the terminal; a word is never broken."""
    lines = [f"{status['car']}  {headline(status)}", "-" * min(RULE_WIDTH, columns)]
    if silent_s > SILENT_S:
        lines.insert(1, f"!! nothing heard for {silent_s:.1f} s: what follows is old (car off? radio gone?)")
    lines += [f"{name:<{LABEL}}{text}" for name, text in _rows(status) if text]
    return [part for line in lines for part in _fitted(one_line(line), columns)]


def _fitted(line: str, columns: int) -> list[str]:
    return textwrap.wrap(
        line, max(columns, 2 * LABEL), subsequent_indent=" " * LABEL, break_long_words=False, break_on_hyphens=False
    )


def columns_here() -> int:
    """Return the columns of the terminal; elsewhere no line is broken."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else LONGEST


def condition_lines(condition: Mapping[str, Any]) -> tuple[str, str]:
    """Return the state with its reason, and what clears it; empty for a car that does not report it."""
    if not condition:
        return "", ""
    reason = because(condition["reason"], condition.get("measure"))
    return f"{condition['state']}, for {condition['for_s']:.0f} s: {reason}", str(condition["clears"])


def _rows(status: Status) -> Iterator[tuple[str, str]]:
    yield from zip(("state", "to clear"), condition_lines(status.get("condition") or {}), strict=True)
    yield from _decision_rows(status)
    yield from _device_rows(status)
    yield from _program_rows(status)


def _decision_rows(status: Status) -> Iterator[tuple[str, str]]:
    output = status["output"]
    if output is not None:
        yield (
            "drive",
            (
                f"asked {_mps(output['asked_mps'])}, allowed {_mps(output['allowed_mps'])},"
                f" sent {_mps(output['speed_mps'])} {steering_words(output['steering_rad'])},"
                f" measured {_mps(status['speed_mps'])}{'' if output['delivered'] else '  NO MOTOR TAKES IT'}"
            ),
        )
    label = "gates"
    for gate, closed in status["gates"].items():
        yield label, f"{gate:<12}{'CLOSED: ' + closed if closed else 'open'}"
        label = ""
    label = "voices"
    for source, voice in status["voices"].items():
        yield label, f"{source:<14}{_voice(voice)}"
        label = ""
    yield "operator", _operator(status.get("operator"))
    yield "not bound", overruled_words(status.get("overruled"))


def _device_rows(status: Status) -> Iterator[tuple[str, str]]:
    yield "battery", battery_words(status["battery"])
    yield "computer", computer_words(status.get("computer") or {})
    yield "fault", status["fault"]
    for device in ("lidar", "motor"):
        health = status[device]
        counts = ", ".join(f"{times} {what.replace('_', ' ')}" for what, times in health["counts"].items() if times)
        since = "recovered since the start" if health["link"] == "ready" else "since the start"
        yield device, f"{health['link']}: {health['message']}{f'; {since}: {counts}' if counts else ''}"
    yield "notices", "; ".join(status["window"]) or "none"
    yield "pose", pose_words(status.get("pose") or {})
    yield "own parts", own_parts_words(status.get("own_parts") or {})


def _program_rows(status: Status) -> Iterator[tuple[str, str]]:
    latency = status["scan_to_motor_ms"]
    if latency["p50"] is not None:
        yield "latency", f"scan to motor p50 {latency['p50']} ms, p99 {latency['p99']} ms, longest {latency['max']} ms"
    if "Python" in (hot_path := status.get("hot_path", "")):
        yield "kernel", hot_path
    if recording := status.get("recording"):
        yield "record", ", ".join(filter(None, (recording["words"], recording["file"])))
    yield "link", ", ".join(f"{name} {value}" for name, value in status["link"].items())
    label = "routers"
    for endpoint, problem in (status.get("routers") or {}).items():
        yield label, f"{endpoint}  {problem or 'connected'}"
        label = ""
    yield "software", f"wallride {status['version']}, up {status['up_s']:.0f} s, {status['scans']} scans"


def battery_words(battery: Mapping[str, Any] | None) -> str:
    """Return a line on the battery."""
    if not battery:
        return "unknown"
    if battery["voltage_v"] is None:
        return "not measured"
    cells, sag_v = battery.get("cells"), battery.get("sag_v")
    parts = (
        f"{battery['voltage_v']:.1f} V, {battery['current_a'] or 0.0:.1f} A",
        f"{cells} cells, {battery['voltage_v'] / cells:.2f} V each" if cells else "",
        f"at least {sag_v:.1f} V under load" if sag_v is not None else "",
        str(battery.get("trouble") or ""),
    )
    return ", ".join(filter(None, parts))


def computer_words(computer: Mapping[str, Any]) -> str:
    """Return a line on the computer; "" for one that reports nothing."""
    temperature_c = computer.get("temperature_c")
    warmth = f"{temperature_c:.0f} C ({computer.get('zone')})" if temperature_c is not None else ""
    return ", ".join(filter(None, (warmth, str(computer.get("trouble") or ""))))


def pose_words(pose: Mapping[str, Any]) -> str:
    """Return a line on the place on the map; "" for a car without a map."""
    if not pose:
        return ""
    on = f"on {pose['map']}: "
    if pose["whereabouts"] == "located":
        turn_deg = math.degrees(pose["yaw_rad"])
        fits = f", {100 * pose['fits']:.0f} % of the beams fit" if pose["fits"] is not None else ""
        place = f"x {pose['x_m']:.2f} m, y {pose['y_m']:.2f} m, {turn_deg:.0f} deg"
        return f"{on}{place}, known to {100 * pose['std_m']:.0f} cm{fits}{_race_words(pose.get('race'))}"
    if pose["whereabouts"] == "ambiguous":
        alike = "; ".join(f"x {x_m:.1f} m, y {y_m:.1f} m" for x_m, y_m, _ in pose["alike"])
        return f"{on}AMBIGUOUS: these places look alike: {alike}"
    return f"{on}{'LOST, it is looked for everywhere' if pose['whereabouts'] == 'lost' else 'being looked for'}"


def _race_words(race: Mapping[str, Any] | None) -> str:
    """Return what is told of the laps; "" before the first."""
    if not race or not race["laps"]:
        return ""
    errors = f"{100 * race['rms_m']:.1f} cm from the line (rms), {100 * race['p99_m']:.0f} cm in 99 % of it"
    return f"; lap {race['laps']}: {race['time_s']:.2f} s, best {race.get('best_s') or race['time_s']:.2f} s, {errors}"


def own_parts_words(own_parts: Mapping[str, Any]) -> str:
    """Return a line on the parts of the car that its lidar sees."""
    patches = own_parts.get("patches", ())
    said = ", ".join(f"{part['bearing_deg']:.0f} deg at {part['range_m']:.2f} m" for part in patches) or "none known"
    since = own_parts.get("remembered")
    return f"{said} (remembered since {since})" if since and patches else said


def _voice(voice: Mapping[str, Any]) -> str:
    if voice["age_s"] is None:
        return "silent"
    age = f"{voice['age_s']:6.2f} s ago  "
    if not voice["live"]:
        return f"{age}no longer in force"
    reason = because(voice["reason"], voice["measure"])
    if voice["caps"]:
        allows = "no limit" if voice["speed_mps"] is None else f"at most {_mps(voice['speed_mps'])}"
        return f"{age}{allows}: {reason}"
    return f"{age}wants {_mps(voice['speed_mps'])} {steering_words(voice['steering_rad'])}: {reason}"


def overruled_words(overruled: Mapping[str, Any] | None) -> str:
    """Return the warning of safety to a human whom it does not bind, and the switch; "" without a warning."""
    if not overruled:
        return ""
    said = because(str(overruled.get("reason", "")), overruled.get("measure"))
    return f"safety says {said}, and does not bind the human: {BIND}"


def _operator(operator: Mapping[str, Any] | None) -> str:
    if operator is None:
        return "no operator's side"
    round_trip_s, name, lost = operator["round_trip_s"], operator["operator"], operator["standing"] == "operator lost"
    parts = [
        f"not operated, {name or 'the last one'} was lost" if lost else name or "not operated",
        operator["standing"] if operator["standing"] != OperatorState.ABSENT and not lost else "",
        "" if lost and "lost" in operator["reason"] else operator["reason"],
        f"round trip {round_trip_s * 1000:.0f} ms" if round_trip_s is not None else "",
        f"{operator['sessions']} clients heard" if operator["sessions"] > 1 else "",
        _permit(operator["permit"]),
        *(f"{what} refused {times}" for what, times in operator["refused"].items() if times),
    ]
    return ", ".join(part for part in dict.fromkeys(parts) if part)


def _permit(reason: str) -> str:
    """Return the reason of the permit's state with its subject, which some reasons begin with."""
    return f"permit: {reason}" if reason and not reason.startswith("permit ") else reason


def _mps(speed_mps: float | None) -> str:
    return f"{speed_mps + 0.0:.2f} m/s" if speed_mps is not None else "-"
