"""The README's "The car in five steps", typed line by line into a terminal, with `wallride emulate` as the car.

The home is new and the environment empty but for the line that `wallride emulate` prints to be pasted. Run as they
stand: all lines with `wallride`, and the service's own command behind `systemctl start` and `restart`. What a test
cannot do to its computer, and what takes its place:

* `sudo`: nothing; the line behind it runs as this user. /etc/wallride is a folder of the test, with the emulated car's
  car.toml.
* ports 10940 and 7447, which other tests may have: free ones.
* `sh install.sh`: its --dry-run; tests/wallride/test_install.py and tests/wallride/deploy install below another root.
* `usermod`, and logging in again: only what is typed is compared, because accounts are root's.
* `systemctl`, `journalctl`: the unit's ExecStart, and its output.
* `0.0.0.0`: 127.0.0.1, because a test opens no port to the network.
* `wallride calibrate` is ended once it asks for the key; tests/sim/virtual and decision 41 have its drives.
"""

import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from wallride.runtime.parameters.toml_text import set_value

ROOT = Path(__file__).resolve().parents[2]
SECTION = re.compile(r"^## The car in five steps\n(.*?)^## ", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^( *)```sh\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
STOP = "\x03"
EMULATE = "wallride emulate --vesc-timeout 1 --vesc-brake 0"
"""As docs/bring-up.md writes it, for a motor controller as it is sold."""
WALLRIDE = """#!{python}
import sys
from pathlib import Path
import wallride.parser
wallride.parser.DEFAULT_CONFIG = Path("{etc}/car.toml")
from wallride import cli, keys_options
from wallride.bringup import emulate_options
keys_options.DEFAULT_DIR = Path("{etc}/keys")
emulate_options.LIDAR_PORT = 0
sys.exit(cli.main())
"""
STAND_INS = {
    "sudo": '#!/bin/sh\n[ "$*" != "sh install.sh" ] || set -- "$@" --dry-run\nexec "$@"\n',
    "usermod": '#!/bin/sh\n[ "$*" = "-aG dialout racer" ]\n',
    "journalctl": '#!/bin/sh\n[ "$*" = "-u wallride" ] && cat "$HOME/service.log"\n',
    "systemctl": """#!/bin/sh
[ "$2" = wallride ] || exit 4
case $1 in start) ;; restart) kill "$(cat "$HOME/service.pid")" ;; *) exit 3 ;; esac
setsid {exec_start} >"$HOME/service.log" 2>&1 </dev/null &
echo $! >"$HOME/service.pid"
for _ in $(seq 150); do
    grep -q 'motor ready' "$HOME/service.log" && grep -q 'lidar ready' "$HOME/service.log" && exit 0
    sleep 0.2
done
exit 1
""",
}
TYPED = [
    # (what the line does, what is typed when the terminal says what, words that must have been said)
    ("sh install.sh", {}, ["install wallride", "service"]),
    ("usermod", {}, []),
    ("wallride vesc set", {"write it?": "y\n"}, ["1000 ms  ->  150 ms", "bytes as wanted"]),
    (
        "wallride doctor --only motor",
        {"to begin": "wheels up\n", "forward?": "y\n", "to the left": "y\n"},
        ["ok    direction"],
    ),
    ("wallride doctor", {}, ["ok    lidar ", "ok    motor timeout", "ok    settings"]),
    ("wallride run", {"navigation: wall": STOP}, ["motor ready", "asked to stop"]),
    ("systemctl start", {}, []),
    ("systemctl restart", {}, []),
    ("journalctl", {}, ["motor ready"]),
    ("wallride calibrate", {"to drive; let go": STOP}, []),
    ("wallride teleop", {"ready": STOP}, ["hold"]),
    ("wallride monitor", {"the monitor is at": STOP}, ["http://"]),
    ("wallride keys init", {}, ["has keys"]),
    ("wallride keys add", {}, ["alice is an operator"]),
]
CODES = {
    "wallride doctor": {0, 1, 2},
    "wallride doctor --only motor": {0, 1, 2},
    "wallride calibrate": {130},
}
"""Of the doctor only the findings on the emulated car count: this computer is no car's."""
PATIENCE_S = 60.0


def lines_of(text):
    """Return the lines of the section's blocks, as a person types them."""
    section = SECTION.search(text)
    assert section is not None, "the README has its five steps"
    return [line.strip() for _, block in BLOCK.findall(section[1]) for line in block.splitlines() if line.strip()]


LINES = lines_of((ROOT / "README.md").read_text(encoding="utf-8"))


def rule_of(line):
    """Return what to type for a line: the first rule that fits."""
    plain = line.removeprefix("sudo ")
    rule = next((rule for rule in TYPED if plain == rule[0] or plain.startswith(f"{rule[0]} ")), None)
    assert rule is not None, f"say in TYPED how to try this line: {line}"
    return rule


class Newcomer:
    """A home, a clone, a folder for /etc/wallride; nothing else in the environment."""

    def __init__(self, folder):
        self.folder, self.etc, self.home = folder, folder / "etc/wallride", folder / "home"
        self.clone, bin_folder = folder / "clone", folder / "bin"
        for place in (self.etc, self.home, self.clone, bin_folder):
            place.mkdir(parents=True)
        for name in ("install.sh", "pyproject.toml", "constraints.txt"):
            (self.clone / name).symlink_to(ROOT / name)
        unit = (ROOT / "systemd/wallride.service").read_text(encoding="utf-8")
        command = unit.partition("\nExecStart=")[2].partition("\n")[0]
        command = command.replace("/opt/wallride/bin/", f"{bin_folder}/").replace("/etc/wallride", str(self.etc))
        tools = STAND_INS | {"wallride": WALLRIDE.format(python=sys.executable, etc=self.etc)}
        for name, text in tools.items():
            (bin_folder / name).write_text(text.replace("{exec_start}", command))
            (bin_folder / name).chmod(0o755)
        with socket.socket() as trial:
            trial.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{trial.getsockname()[1]}"
        self.environment = {
            "HOME": str(self.home), "PATH": f"{bin_folder}:/usr/bin:/bin:/usr/sbin:/sbin", "TERM": "xterm",
            "USER": "racer", "LANG": "C.UTF-8", "BROWSER": "true", "WALLRIDE_CONNECT": self.endpoint,
            "PYTHONPATH": str(ROOT),
        }  # fmt: skip

    def plug_in(self):
        """Start the emulated car, a new one, and paste the line that it prints."""
        self.car = subprocess.Popen(
            ["sh", "-c", f"exec {EMULATE}"], env=self.environment, stderr=subprocess.PIPE, text=True,
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        line = next(line for line in self.car.stderr if line.strip().startswith("export "))
        name, _, file = line.strip().removeprefix("export ").partition("=")
        self.environment[name] = file
        settings = Path(file)
        text = set_value(settings.read_text(encoding="utf-8"), ("telemetry", "listen"), [self.endpoint])
        settings.write_text(text, encoding="utf-8")
        (self.etc / "car.toml").symlink_to(settings)

    def type_in(self, line, answers):
        """Type a line into a terminal, and each answer when its words come; return the exit code and what was said."""
        line = line.replace("0.0.0.0", "127.0.0.1")
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(self.clone)
            os.execve("/bin/sh", ["sh", "-c", f"exec {line}"], self.environment)  # noqa: S606 - this is the shell
        said, waiting, give_up_s = "", dict(answers), time.monotonic() + PATIENCE_S
        while time.monotonic() < give_up_s:
            if not select.select([terminal], [], [], 1.0)[0]:
                continue
            try:
                said += os.read(terminal, 4096).decode(errors="replace")
            except OSError:  # the other end is closed
                break
            for words in [words for words in waiting if words in said]:
                os.write(terminal, waiting.pop(words).encode())
        else:
            os.kill(pid, signal.SIGKILL)
            said += f"\n(ended after {PATIENCE_S:g} s)"
        _, status = os.waitpid(pid, 0)
        os.close(terminal)
        assert not waiting, f"{line}: it never said {list(waiting)}: {said}"
        return os.waitstatus_to_exitcode(status), said

    def leave(self):
        """End the service and the car."""
        file = self.home / "service.pid"
        if file.exists():
            os.kill(int(file.read_text()), signal.SIGTERM)
        self.car.send_signal(signal.SIGINT)
        self.car.wait(20)
        self.car.stderr.close()


@pytest.fixture
def newcomer(tmp_path):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where a shell runs in the background
    one = Newcomer(tmp_path)
    one.plug_in()
    yield one
    one.leave()
    signal.signal(signal.SIGINT, before)


@pytest.mark.timeout(400)
def test_the_five_steps_do_what_they_say(newcomer):
    assert len(LINES) <= 15, "box to driving in 15 commands"
    for line in LINES:
        what, answers, words = rule_of(line)
        code, said = newcomer.type_in(line, answers)
        assert code in CODES.get(what, {0}), f"{line}: exit code {code}: {said}"
        assert [word for word in words if word not in said] == [], f"{line}: {said}"


def test_every_rule_is_for_a_line_that_is_there():
    assert {rule_of(line)[0] for line in LINES} == {rule[0] for rule in TYPED}


@pytest.mark.parametrize(
    ("line", "broken"),
    [
        ("wallride vesc set", "wallride vesc set --timeout 150"),
        ("sudo usermod -aG dialout $USER", "sudo usermod -aG dailout $USER"),
        ("sudo systemctl start wallride", "sudo systemctl start wallrid"),
        ("sudo wallride keys init", "sudo wallride keys initialise"),
        ("wallride monitor --host 0.0.0.0", "wallride monitor --hots 0.0.0.0"),
    ],
)
def test_a_line_that_is_wrong_is_found(line, broken, tmp_path):
    assert line in LINES
    one = Newcomer(tmp_path)
    code, said = one.type_in(broken, {})
    assert code not in CODES.get(rule_of(line)[0], {0}), said


def test_a_line_that_is_not_known_is_found():
    text = "## The car in five steps\n1. One\n\n   ```sh\n   wallride fly\n   ```\n\n## Next\n"
    assert lines_of(text) == ["wallride fly"]
    with pytest.raises(AssertionError, match="how to try this line"):
        rule_of("wallride fly")
