"""What comes as a file: settings, people, MCAP, ROS bags, archives of arrays. Each target takes any bytes."""

import io
import shutil
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores

from tests.sim.recordings.conftest import Stage, story
from wallride.clients import log_info
from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.parameters.file import marked
from wallride.runtime.recording.recover import RecoveryError, recover
from wallride.runtime.security.access_list import KeysError, read_people
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings, to_toml
from wallride.sim.recordings.loading import load_recording
from wallride.sim.recordings.recording import RecordingError


class Files:
    """A folder in memory for one file at a time, and good files of every kind."""

    def __init__(self):
        place = Path("/dev/shm")
        self._scratch = tempfile.TemporaryDirectory(dir=place if place.is_dir() else None)
        self.folder = Path(self._scratch.name)

    def close(self):
        """Delete the folder."""
        self._scratch.cleanup()

    def path(self, name, data):
        """Return a file with this content."""
        path = self.folder / name
        path.write_bytes(data)
        return path

    def settings(self, _dice, data):
        """Load a settings file, and what a start looks for in it."""
        path = self.path("car.toml", data)
        try:
            load_settings(path)
        except SettingsError:
            pass
        marked(path)

    def people(self, _dice, data):
        """Load an access list."""
        try:
            read_people(self.path("people.toml", data))
        except KeysError:
            pass

    def mcap(self, _dice, data):
        """Read, describe and recover a recording of ROS 2."""
        path = self.path("one.mcap", data)
        self._load(path)
        try:
            log_info.read(path)
        except (ConnectionProblemError, OSError):
            pass
        try:
            recover(path)
        except RecoveryError:
            pass

    def bag(self, _dice, data):
        """Read a bag of ROS 1."""
        self._load(self.path("one.bag", data))

    def npz(self, _dice, data):
        """Read an archive of arrays."""
        self._load(self.path("one.npz", data))

    @staticmethod
    def _load(path):
        try:
            load_recording(path)
        except RecordingError as error:
            assert len(str(error)) < 2000

    def seeds(self):
        """Return (target, seeds, most bytes) by name."""
        ros1, ros2 = Stage(Stores.ROS1_NOETIC), Stage(Stores.ROS2_HUMBLE)
        bag = ros1.write(self.folder / "good.bag", story(ros1, 3)).read_bytes()
        said = ros2.write(self.folder / "good", story(ros2, 3), StoragePlugin.MCAP)
        mcap = next(said.glob("*.mcap")).read_bytes()
        shutil.rmtree(said)
        people = b'[ann]\nrole = "operator"\nexpires = 2027-05-01\nrevoked = 2027-01-01\n'
        return {
            "settings": (
                self.settings,
                [to_toml(Settings()).encode(), b"[car]\nname = 'a'\n[mux]\ntick_hz = 50\n"],
                9000,
            ),
            "people": (self.people, [people], 4000),
            "mcap": (self.mcap, [mcap], 60_000),
            "bag": (self.bag, [bag], 60_000),
            "npz": (self.npz, [_archive(np.savez), _archive(np.savez_compressed)], 60_000),
        }


def _archive(save):
    buffer = io.BytesIO()
    save(
        buffer, ranges=np.ones((3, 5), np.float32), stamps=np.arange(3.0), recv=np.arange(3.0), angle_min=-1.0,
        angle_increment=0.5, range_min=0.02, range_max=30.0, scan_time=0.025,
        nav__speed_steering=np.ones((3, 2)), nav__recv=np.arange(3.0),
    )  # fmt: skip
    return buffer.getvalue()
