"""Every other command of README and docs/bring-up.md, typed as written, with `wallride emulate` as the car.

All in one environment. The five steps' own lines are typed in test_five_steps.py, in one like it. A command that needs
what no test has (another computer, root, a network, the checkout's own files) names the test that tries it otherwise.
"""

import re
from pathlib import Path

import pytest

from tests.docs.test_five_steps import BLOCK, EMULATE, LINES, ROOT, SECTION, STOP, Newcomer

PROGRAMS = "wallride|make|sh|pip|apt|apt-get|systemctl|journalctl|rm|kill|usermod"
SPAN = re.compile(rf"`((?:sudo )?(?:{PROGRAMS}) [^`]*)`")
INDENTED = re.compile(rf"^    ((?:sudo )?(?:{PROGRAMS}) .*)$", re.MULTILINE)
FILES = {
    "vesc.yaml": "vesc_driver:\n  ros__parameters:\n    speed_max: 23250.0\n"
    "ackermann_to_vesc_node:\n  ros__parameters:\n    speed_to_erpm_gain: 4614.0\n"
    "    steering_angle_to_servo_gain: -1.2135\n    steering_angle_to_servo_offset: 0.5304\n",
    "params.yaml": "wall_follower:\n  ros__parameters:\n    side: -1\n    velocity: 1.0\n    desired_distance: 0.9\n",
    "fitted.toml": "[vehicle]\nsteering_delay_s = 0.07\n",
}
"""What a reader has before the lines that use it."""
MADE = {"FILE": "vesc/*.json", "FILE.mcap": "*.mcap"}
"""What a line before has made."""
WHEELS_UP = {"to begin": "wheels up\n", "forward?": "y\n", "to the left": "y\n"}
TYPED = {
    # line: (what is typed when the terminal says what, exit codes, words that must have been said)
    "wallride run --set motor.address=serial:///dev/none": (
        {"lidar ready: UST-10LX, 1081 beams, 40 Hz": STOP}, {0}, ["functions of the hot path are compiled"],
    ),
    "wallride doctor": ({}, {0, 1, 2}, ["ok    lidar "]),
    "wallride doctor --only lidar": ({}, {0, 1, 2}, ["ok    lidar "]),
    "wallride vesc set": ({"write it?": "y\n"}, {0}, ["1000 ms  ->  150 ms", "bytes as wanted"]),
    "wallride vesc restore FILE": ({"write it?": "y\n"}, {0}, ["150 ms  ->  1000 ms"]),
    "wallride doctor --only motor": ({}, {0, 1, 2}, ["motor timeout"]),
    "wallride doctor --only motor --wheels-up": (WHEELS_UP, {0, 1, 2}, ["ok    direction"]),
    "wallride run": ({"motor ready: VESC ": STOP}, {0}, ["firmware", "settings of "]),
    "wallride import vesc.yaml": ({}, {0}, ["steering_to_servo_offset = 0.5304"]),
    "wallride import vesc.yaml params.yaml --output car.toml": ({}, {0}, ["car.toml"]),
    "wallride sim --conditions fitted.toml": ({"http://": STOP}, {0}, ["steering_delay_s"]),
    "wallride report": ({}, {0}, [".html: "]),
    "wallride new law my_laws.py": ({}, {0}, ["class Follower"]),
    "wallride lab fit FILE.mcap --out fitted.toml": ({}, {0}, ["Try it: wallride sim --conditions fitted.toml"]),
    "wallride service status": ({}, {0, 1, 2}, ["service"]),  # 2 where the clone lies in a temporary folder
    # From here on the service is started.
    "sudo systemctl start wallride": ({}, {0}, []),
    "wallride status": ({}, {0}, ["gates"]),
    "wallride param save": ({}, {0}, []),
    "wallride teleop": ({"ready": STOP}, {0}, ["hold"]),
    "wallride monitor": ({"the monitor is at": STOP}, {0}, ["http://"]),
    "wallride calibrate": ({"to drive; let go": STOP}, {130}, []),
    "wallride calibrate lidar": ({"to drive; let go": STOP}, {130}, []),
}  # fmt: skip
BY_OTHER_TESTS = {
    "sudo wallride service install": "tests/wallride/test_service.py",
    "service uninstall": "tests/wallride/test_service.py",
    "wallride deploy user@car": "tests/wallride/deploy/test_over_ssh.py",
    "wallride deploy racer@car --dry-run": "tests/wallride/deploy/test_over_ssh.py",
    "wallride deploy racer@car": "tests/wallride/deploy/test_over_ssh.py",
    "wallride deploy racer@car --rollback": "tests/wallride/deploy/test_over_ssh.py",
    "wallride deploy racer@car --python FILE": "tests/wallride/deploy/test_over_ssh.py",
    "wallride build-kernel": "tests/runtime/kernel/test_kernel.py",  # would change the checkout's own file
    "sudo sh install.sh": "tests/docs/test_five_steps.py",
    "wallride emulate": "tests/docs/test_five_steps.py",
    "make sim": "tests/docs/test_makefile.py",
    "make race": "tests/docs/test_makefile.py",
    "make test": "tests/docs/test_makefile.py",
    "make check": "tests/docs/test_makefile.py",
    "systemctl status wallride": "tests/wallride/test_service.py",
    "journalctl -u wallride": "tests/docs/test_five_steps.py",
    "kill -9": "tests/system/test_process.py",
}
NAMES = {"wallride import", "wallride topic", "wallride param"}
"""Named in README's table, not typed."""
OF_THE_COMPUTER = {
    "apt install gcc python3-dev", "sudo apt-get install python3.11 python3.11-venv", "pip install",
    "pip install '.[deploy]'",
    "sudo rm -r /opt/wallride /opt/wallride-versions /usr/local/bin/wallride",
}  # fmt: skip
"""Other programs' own commands, which install or delete."""


def commands_of(text):
    """Return the commands of a page, each once: of its blocks, indented lines and spans."""
    blocks = [line.split("  #")[0].strip() for _, block in BLOCK.findall(text) for line in block.splitlines()]
    inline = [line.split("  #")[0].strip() for line in INDENTED.findall(text)]
    spans = [" ".join(span.split()) for span in SPAN.findall(BLOCK.sub("", text))]
    return list(dict.fromkeys(filter(None, [*blocks, *inline, *spans])))


PAGES = [(ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/bring-up.md")]
COMMANDS = [
    command for command in dict.fromkeys(command for page in PAGES for command in commands_of(page))
    if command not in LINES
]  # fmt: skip


def test_every_command_of_both_pages_is_tried_somewhere():
    assert len(COMMANDS) > 25
    unknown = [one for one in COMMANDS if one not in {*TYPED, *BY_OTHER_TESTS, *NAMES, *OF_THE_COMPUTER}]
    assert unknown == [], "say in TYPED how to try it, or which test does"
    assert [path for path in BY_OTHER_TESTS.values() if not (ROOT / path).exists()] == []


def test_what_is_tried_is_on_the_pages():
    every = "\n".join(" ".join(page.split()) for page in PAGES)
    assert [one for one in (*TYPED, *BY_OTHER_TESTS, *NAMES, *OF_THE_COMPUTER) if one not in every] == []
    assert SECTION.search(PAGES[0]) is not None
    assert EMULATE.removeprefix("wallride emulate ") in every


@pytest.mark.timeout(500)
def test_the_pages_other_commands_do_what_they_say(tmp_path):
    reader = Newcomer(tmp_path)
    reader.plug_in()
    try:
        for name, text in FILES.items():
            (reader.clone / name).write_text(text, encoding="utf-8")
        failed = [words for line in TYPED if (words := tried(reader, line))]
        assert failed == []
    finally:
        reader.leave()


def tried(reader, line):
    """Type a line; return what was not as it should be, "" where all was."""
    answers, codes, wanted = TYPED[line]
    typed = line
    for name, pattern in MADE.items():
        if name in typed.split():
            typed = typed.replace(name, str(newest(reader.home, pattern)))
    code, said = reader.type_in(typed, answers)
    missing = [words for words in wanted if words not in said]
    return f"{line}: exit code {code}, without {missing}: {said}" if code not in codes or missing else ""


def newest(folder: Path, pattern: str) -> Path:
    """Return the newest file of a home."""
    found = [path for path in folder.rglob(pattern) if path.is_file()]
    assert found, f"no {pattern} in {[str(path) for path in folder.rglob('*')]}"
    return max(found, key=lambda path: path.stat().st_mtime)
