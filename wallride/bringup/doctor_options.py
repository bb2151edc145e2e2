"""Options of `wallride doctor`. The checks are imported when the command runs."""

import argparse
import sys

from wallride.doctor import GROUPS
from wallride.failure import fail
from wallride.parser import Commands, add_config, add_set, default_config
from wallride.runtime.host.terminal_text import asked, say, yes_or_no

CONFIRMED = "wheels up"


def add(commands: Commands) -> None:
    """Add the command and its options."""
    doctor = commands.add_parser(
        "doctor",
        help="look at everything from cable to certificate, with the remedy",
        description="Looks at program, computer, ports, devices, keys and gamepad, and says what to do. It opens the"
        " devices, so the car must not run meanwhile; it moves nothing without --wheels-up. Exit code: 0 all ok,"
        " 1 warnings, 2 something to mend before it drives.",
    )
    doctor.set_defaults(run=run)
    add_config(doctor)
    add_set(doctor)
    doctor.add_argument(
        "--only", action="append", choices=GROUPS, metavar="GROUP", help=f"{', '.join(GROUPS)} (repeatable)"
    )
    doctor.add_argument("--json", action="store_true", help="the answer as JSON")
    doctor.add_argument(
        "--wheels-up", action="store_true",
        help="TURNS THE WHEELS, after a confirmation: direction, command timeout, brake, steering by measurement",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Look at everything; the exit code says how it is."""
    import asyncio
    import logging

    from wallride.doctor.computer import this_computer
    from wallride.doctor.examine import examine, find_settings
    from wallride.doctor.findings import as_json, exit_code, line, summary

    if options.wheels_up and (options.json or "motor" not in (options.only or GROUPS)):
        return fail("--wheels-up asks about the motor: leave --json out, and add --only motor where there is --only")
    if options.wheels_up and not sys.stdin.isatty():
        return fail("--wheels-up turns the wheels: put the car on a stand, run it in a terminal and confirm")
    if options.wheels_up and not _confirmed():
        return fail("nothing was turned: --wheels-up needs the confirmation")
    logging.getLogger().addHandler(logging.NullHandler())  # what the drivers log is in the findings
    groups = options.only or GROUPS
    settings, wrong, first = find_settings(options.config or default_config(), options.assignments, groups)
    found = [first]

    async def look() -> None:
        ask = _answer if options.wheels_up else None
        async for finding in examine(this_computer(), settings, groups, wheels_up=ask, wrong=wrong):
            found.append(finding)
            if not options.json:
                say(line(finding))

    if not options.json:
        say(line(first))
    asyncio.run(look())
    say(as_json(found) if options.json else summary(found))
    return exit_code(found)


def _confirmed() -> bool:
    print("The wheels will turn at 0.7 m/s and steer. Put the car on a stand, wheels in the air, hands off.")
    return asked(f"type '{CONFIRMED}' to begin, Enter to leave it: ", _confirming, default=False)


def _confirming(text: str) -> bool:
    if text.lower() != CONFIRMED:
        raise ValueError(f"type the two words {CONFIRMED}, or Enter alone")
    return True


def _answer(question: str) -> bool | None:
    return yes_or_no(question) if sys.stdin.isatty() else None
