"""The one ssh connection of a deployment, and what its errors mean."""

import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, Self, cast

from wallride.deploy.car_process import CarProcess, TooMuchError
from wallride.deploy.facts import DeployError
from wallride.runtime.host.terminal_text import one_line, say

ON_CAR: Final = (Path(__file__).parent / "on_car.sh").read_text(encoding="utf-8")
LIVENESS: Final = ("ConnectTimeout=10", "ServerAliveInterval=5", "ServerAliveCountMax=3")
"""A dead connection is noticed within 15 s."""
NOT_SSH: Final = 255
"""Exit code of ssh itself, and of no command of ours."""
LOG_OUT_WITHIN_S: Final = 10.0
SILENT_S: Final = 120.0
"""Timeout of an answer, and of a copy that makes no progress: a car on an old SD card is slow, not endless."""
SILENT_INSTALLATION_S: Final = 1800.0
"""Timeout of the next line of install.sh: compiling on a small computer says nothing for minutes."""
DOING: Final = {
    "facts": "looking at it",
    "absent": "looking for wheels on it",
    "receive": "copying",
    "may_sudo": "sudo",
}
EXPLAINED: Final = (
    (
        "identification has changed",
        "its host key has changed: if it was installed anew, ssh-keygen -R, then ssh {host}",
    ),
    ("host key verification failed", "its host key is not known: run  ssh {host}  once and compare the fingerprint"),
    ("permission denied", "it accepts none of your keys: run  ssh-copy-id {host}"),
    ("could not resolve", "its name is not known here: give its address, or name it in ~/.ssh/config"),
    ("connection refused", "no ssh server answers there: apt-get install openssh-server on the car"),
    ("timed out", "it does not answer: is it on, and in this network?"),
    ("no route to host", "it does not answer: is it on, and in this network?"),
    ("network is unreachable", "this computer has no network to it"),
)


def explain(host: str, said: str) -> str:
    """Return one line on why ssh did not reach the host, with the remedy. said: ssh's standard error."""
    lowered = said.lower()
    for mark, words in EXPLAINED:
        if mark in lowered:
            return f"{host}: {words.format(host=host)}"
    last = said.strip().splitlines()[-1] if said.strip() else "it ended without a word"
    return f"{host}: ssh could not connect: {last}"


class SshConnection:
    """A car reached by ssh: one login, which every command uses. config: a file for `ssh -F`.

    Everything that runs there is `on_car.sh`, by its actions.
    """

    def __init__(self, host: str, config: Path | None = None) -> None:
        self.host = host.replace("[", "").replace("]", "")  # as in an endpoint; ssh takes an IPv6 address without
        self._config = ["-F", str(config)] if config is not None else []
        self._folder = tempfile.TemporaryDirectory(prefix="wallride-ssh-")
        self._socket = str(Path(self._folder.name) / "s")

    def __enter__(self) -> Self:
        """Log in; DeployError with the remedy where that fails."""
        batch = [] if sys.stdin.isatty() else ["-o", "BatchMode=yes"]
        liveness = [word for option in LIVENESS for word in ("-o", option)]
        # Its standard error goes to a file: the master keeps what it is given open.
        with (Path(self._folder.name) / "said").open("w+", encoding="utf-8") as said:
            login = ["ssh", *self._config, *batch, *liveness, "-M", "-N", "-f", "-S", self._socket, "--", self.host]
            try:
                done = subprocess.run(login, stdout=subprocess.DEVNULL, stderr=said, check=False)
            except FileNotFoundError:
                raise DeployError("ssh is missing here: install the package openssh-client") from None
            said.seek(0)
            if done.returncode != 0:
                self._folder.cleanup()
                raise DeployError(explain(self.host, said.read()))
        return self

    def __exit__(self, *_: object) -> None:
        """Log out."""
        self._log_out()
        self._folder.cleanup()

    def _log_out(self) -> None:
        """End the login with all its commands; the pipes of a command are the login's, too."""
        leave = ["ssh", *self._config, "-S", self._socket, "-O", "exit", "--", self.host]
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(leave, capture_output=True, check=False, timeout=LOG_OUT_WITHIN_S)

    def ask(self, *action: str, text: str = "") -> str:
        """Return what an action prints; DeployError where it fails. text: its standard input."""
        try:
            with CarProcess(self._command(action), SILENT_S, disconnect=self._log_out) as process:
                with suppress(BrokenPipeError):  # then its words say why
                    process.write(text.encode())
                process.close_input()
                said = process.answer()
                self._check(action[0], process)
        except TooMuchError:
            raise DeployError(f"{self.host}: {DOING[action[0]]}: its answer has no end") from None
        return said

    def feed(self, *action: str, write: Callable[[IO[bytes]], None]) -> None:
        """Run an action, and write its standard input; DeployError where it fails."""
        with CarProcess(self._command(action), SILENT_S, disconnect=self._log_out) as process:
            with suppress(BrokenPipeError):  # then its words say why
                write(cast("IO[bytes]", process))  # tarfile only writes to it
            process.close_input()
            self._check(action[0], process)

    def watch(self, *action: str, text: str = "") -> int:
        """Let an action print here, and return its exit code; NOT_SSH where the connection was lost."""
        with CarProcess(self._command(action), SILENT_INSTALLATION_S, merged=True, disconnect=self._log_out) as process:
            with suppress(BrokenPipeError):
                process.write(text.encode())
            process.close_input()
            for line in process.lines():
                say(one_line(line))
            code = process.end()
        return NOT_SSH if process.silent or code < 0 else code

    def _check(self, action: str, process: CarProcess) -> None:
        """Wait for an action's end; DeployError where it failed."""
        code = process.end()
        if process.silent:
            raise DeployError(
                f"{self.host}: {DOING[action]}: no answer within {SILENT_S:.0f} s; nothing was changed there:"
                f" look at it with  ssh {self.host}"
            )
        if code != 0:
            raise DeployError(self._failure(action, code, process.words))

    def _command(self, action: Sequence[str]) -> list[str]:
        there = shlex.join(["sh", "-c", ON_CAR, "on_car.sh", *action])
        return ["ssh", *self._config, "-S", self._socket, "-o", "BatchMode=yes", "--", self.host, there]

    def _failure(self, action: str, code: int, said: str) -> str:
        doing = DOING[action]
        if code == NOT_SSH:
            return f"{self.host}: the connection was lost ({doing}); nothing was changed there: try again"
        last = said.strip().splitlines()[-1] if said.strip() else f"exit code {code}"
        if "no space left" in said.lower():
            last = "no space left on its disk"
        return f"{self.host}: {doing}: {last}"
