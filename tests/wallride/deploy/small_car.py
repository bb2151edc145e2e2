"""A car for tests: an ssh server of this user on loopback, a root folder, a service manager of files; and a clone.

The clone is a small `wallride` of its own, so that a deployment is real in every step and takes seconds.
"""

import getpass
import importlib.metadata
import os
import shutil
import socket
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[3]
SSHD = "/usr/sbin/sshd"
PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "wallride"
version = "{version}"
dependencies = ["small-tool"]
optional-dependencies = {{ car = ["unused; python_version < '3'"] }}
scripts = {{ wallride = "wallride:main" }}
"""
PROGRAM = """
import json, os, sys
from pathlib import Path
import small_tool

def main():
    match sys.argv[1]:
        case "--version": print("wallride {version}")
        case "run": {run}
        case "status": print(Path(os.environ["CAR_STATUS"]).read_text().replace("MOTOR", "{motor}"))
        case "service":
            root = Path(sys.argv[sys.argv.index("--root") + 1])
            unit, settings = root / "etc/systemd/system/wallride.service", root / "etc/wallride/car.toml"
            unit.parent.mkdir(parents=True, exist_ok=True)
            settings.parent.mkdir(parents=True, exist_ok=True)
            unit.write_text("unit {version}")
            if not settings.exists():
                settings.write_text("shipped")
        case "build-kernel": sys.exit(1)
"""
MANAGER = """#!/bin/sh
case $1 in
    show)
        case $3 in
            --property=ActiveState) cat "$CAR_STATE" 2>/dev/null || echo inactive ;;
            --property=MainPID) echo 42 ;;
        esac ;;
    restart)
        program=$(readlink "$DESTDIR/opt/wallride")/bin/wallride
        echo "restart $program" >>"$CAR_STATE.log"
        while [ -e "$CAR_STATE.hold" ]; do read -r _ <"$CAR_STATE.hold"; done
        if "$DESTDIR$program" run; then echo active >"$CAR_STATE"; else echo failed >"$CAR_STATE"; exit 1; fi ;;
esac
"""


def needs_sshd():
    """Skip a test without an ssh server; fail it where one is promised."""
    if not Path(SSHD).is_file():
        if os.environ.get("WALLRIDE_NEEDS_SSHD"):
            pytest.fail("no ssh server here, and WALLRIDE_NEEDS_SSHD is set: apt-get install openssh-server")
        pytest.skip("no ssh server here: apt-get install openssh-server")


def make_wheel(folder, name, files):
    """Write a wheel of Python alone, without dependencies."""
    info = f"{name}-1.0.dist-info"
    with zipfile.ZipFile(folder / f"{name}-1.0-py3-none-any.whl", "w") as wheel:
        for path, text in files.items():
            wheel.writestr(path, text)
        wheel.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        wheel.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr(f"{info}/RECORD", "")


def wheel_of_pip(folder):
    """Pack this environment's pip into a wheel."""
    pip = importlib.metadata.distribution("pip")
    with zipfile.ZipFile(folder / f"pip-{pip.version}-py3-none-any.whl", "w") as wheel:
        for file in pip.files or ():
            if file.parts[0] != ".." and "__pycache__" not in file.parts:
                wheel.write(str(pip.locate_file(file)), str(file))
    return pip.version


def make_clone(folder, version="1.0", run="pass", motor="ready"):
    """Write a clone. run: what its process does at its start; a sys.exit is a failed one. motor: its state then."""
    (folder / "wallride").mkdir(parents=True, exist_ok=True)
    (folder / "pyproject.toml").write_text(PROJECT.format(version=version))
    (folder / "wallride/__init__.py").write_text(PROGRAM.format(version=version, run=run, motor=motor))
    (folder / "constraints.txt").write_text(f"small-tool==1.0\npip=={importlib.metadata.version('pip')}\n")
    shutil.copy(REPOSITORY / "install.sh", folder)
    return folder


class SmallCar:
    """The car, reached as `car` through its ssh configuration."""

    def __init__(self, folder):
        needs_sshd()
        self.folder, self.root = folder, folder / "root"
        self.config, self.state, self.status = folder / "ssh_config", folder / "state", folder / "status"
        self.tools = folder / "tools"
        for place in (self.root, self.tools, folder / "home"):
            place.mkdir()
        self.tell("disarmed")
        self.tool("systemctl", MANAGER)
        self.tool("sleep", "#!/bin/sh\n")
        for name in ("host_key", "key", "other_key"):
            subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
        self.port = free_port()
        (folder / "known_hosts").write_text(f"[127.0.0.1]:{self.port} {(folder / 'host_key.pub').read_text()}")
        self.configure()
        self.start()

    def configure(self, key="key", known_hosts="known_hosts"):
        """Write the configuration of ssh."""
        self.config.write_text(
            f"Host car\nHostName 127.0.0.1\nPort {self.port}\nUser {getpass.getuser()}\n"
            f"IdentityFile {self.folder / key}\nIdentitiesOnly yes\nIdentityAgent none\n"
            f"UserKnownHostsFile {self.folder / known_hosts}\nGlobalKnownHostsFile /dev/null\n"
        )

    def start(self):
        """Start the server and wait until it answers."""
        values = {
            "DESTDIR": self.root, "SYSTEMCTL": self.tools / "systemctl", "CAR_STATE": self.state,
            "CAR_STATUS": self.status, "XDG_CACHE_HOME": self.folder / "home",
            "PATH": f"{self.tools}:{Path(sys.executable).parent}:{os.defpath}",
        }  # fmt: skip
        as_root = os.geteuid() == 0
        (self.folder / "sshd_config").write_text(
            f"ListenAddress 127.0.0.1\nPort {self.port}\nHostKey {self.folder / 'host_key'}\nPidFile none\n"
            f"AuthorizedKeysFile {self.folder / 'key.pub'}\nPasswordAuthentication no\nStrictModes no\n"
            f"UsePAM {'yes' if as_root and Path('/etc/pam.d/sshd').is_file() else 'no'}\nPermitRootLogin yes\n"
            "SetEnv " + " ".join(f'{name}="{value}"' for name, value in values.items()) + "\n"
        )
        if as_root:
            Path("/run/sshd").mkdir(exist_ok=True)  # the server of root wants it
        with (self.folder / "sshd.log").open("w") as log:
            self.server = subprocess.Popen([SSHD, "-D", "-e", "-f", self.folder / "sshd_config"], stderr=log)
        for _ in range(100):
            with socket.socket() as trial:
                if trial.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)
        self.stop()  # else whichever test comes next is told of it
        raise AssertionError((self.folder / "sshd.log").read_text())

    def stop(self):
        """End the server and all its sessions."""
        sessions = subprocess.run(
            ["ps", "-o", "pid=", "--ppid", str(self.server.pid)], capture_output=True, text=True, check=False
        ).stdout.split()
        for pid in [*map(int, sessions), self.server.pid]:
            with suppress(ProcessLookupError):  # a session that has just ended
                os.kill(pid, 15)
        self.server.wait(10)

    def tool(self, name, text):
        """Put a program before those of the system on the car's PATH."""
        (self.tools / name).write_text(text)
        (self.tools / name).chmod(0o755)

    def tell(self, state):
        """Let the car say this state from now on."""
        self.status.write_text(
            f'{{"condition": {{"state": "{state}"}}, "lidar": {{"link": "ready"}}, "motor": {{"link": "MOTOR"}}}}'
        )

    def in_use(self):
        """Return the folder of the version in use; None without one."""
        link = self.root / "opt/wallride"
        return self.root / link.readlink().relative_to("/") if link.is_symlink() else None

    def versions(self):
        """Return the names of the versions there."""
        return sorted(path.name for path in (self.root / "opt/wallride-versions").glob("2*"))

    def starts(self):
        """Return how often the service was started, and its state."""
        log = Path(f"{self.state}.log")
        return len(log.read_text().splitlines()) if log.exists() else 0, self.state.read_text().strip()

    def program(self):
        """Return the version that the program in use says."""
        said = subprocess.run([self.in_use() / "bin/wallride", "--version"], capture_output=True, text=True, check=True)
        return said.stdout.split()[1]


def free_port():
    """Return a port of loopback that is free now."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return trial.getsockname()[1]
