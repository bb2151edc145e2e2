"""The one ssh connection of a deployment, and what its errors mean."""

import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Final, Self, cast

from wallride.deploy.facts import DeployError

ON_CAR: Final = (Path(__file__).parent / "on_car.sh").read_text(encoding="utf-8")
LIVENESS: Final = ("ConnectTimeout=10", "ServerAliveInterval=5", "ServerAliveCountMax=3")
"""A dead connection is noticed within 15 s."""
NOT_SSH: Final = 255
"""Exit code of ssh itself, and of no command of ours."""
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
        self.host = host
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Log out."""
        leave = ["ssh", *self._config, "-S", self._socket, "-O", "exit", "--", self.host]
        subprocess.run(leave, capture_output=True, check=False)
        self._folder.cleanup()

    def ask(self, *action: str, text: str = "") -> str:
        """Return what an action prints; DeployError where it fails. text: its standard input."""
        done = subprocess.run(self._command(action), input=text, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise DeployError(self._failure(action[0], done.returncode, done.stderr))
        return done.stdout

    def feed(self, *action: str, write: Callable[[IO[bytes]], None]) -> None:
        """Run an action, and write its standard input; DeployError where it fails."""
        with subprocess.Popen(self._command(action), stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            pipe, said = cast("IO[bytes]", process.stdin), cast("IO[bytes]", process.stderr)
            with suppress(BrokenPipeError), pipe:  # then the words on the other pipe say why
                write(pipe)
            words = said.read().decode(errors="replace")
        if process.returncode != 0:
            raise DeployError(self._failure(action[0], process.returncode, words))

    def watch(self, *action: str, text: str = "") -> int:
        """Let an action print here, and return its exit code; 255 where the connection was lost."""
        return subprocess.run(self._command(action), input=text, text=True, check=False).returncode

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
