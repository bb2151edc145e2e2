"""`wallride logs` on this machine: a folder and a ring for each car, simulations apart, and what is kept for good."""

from pathlib import Path

import pytest

from tests.typed import telling
from wallride.clients import logs
from wallride.clients.connection import ConnectionProblemError
from wallride.replay_options import found
from wallride.runtime.recording.ring import MB, entries, folders, keep, trim
from wallride.runtime.settings.recording import RecordingSettings, car_folder

DRIVE = "20261121T084600Z-b0007-{:05d}.mcap"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """Recordings of a car, of a simulated one, and one from before there were folders."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    above = tmp_path / "wallride" / "recordings"
    for place, number in ((".", 1), ("car1", 2), ("car1", 3), ("simulated/sim", 4), ("simulated/sim", 5)):
        folder = above / place
        folder.mkdir(parents=True, exist_ok=True)
        (folder / DRIVE.format(number)).write_bytes(bytes(MB))
    return above


async def said(*words):
    options, lines = telling("logs", *words)
    code = await logs.run(options)
    return code, "\n".join(lines)


def test_each_car_has_a_folder_and_simulations_have_theirs(home):
    def place(**settings):
        name = settings.pop("car", "car1")
        return car_folder(RecordingSettings(**settings), name).relative_to(home).as_posix()

    assert place() == "car1"
    assert place(car="car2") == "car2"
    assert place(car="sim", simulated=True) == "simulated/sim"
    assert str(car_folder(RecordingSettings(folder="/data/drives"), "car1")) == "/data/drives"


async def test_alone_it_lists_everything_here(home):
    code, text = await said()
    assert code == 0
    for name in (DRIVE.format(1), f"car1/{DRIVE.format(3)}", f"simulated/sim/{DRIVE.format(5)}"):
        assert f"-  {name}" in text, "no recording at all has no duration"
    assert text.endswith(f"5 recordings, 5.0 MB in {home}")


async def test_a_black_box_is_listed_as_one(home):
    (home / "car1" / "20261121T084600Z-b0007-00006-stop-wall-ahead.mcap").write_bytes(bytes(MB))
    _, text = await said()
    assert "-stop-wall-ahead.mcap   unfinished   black box of a stop\n" in f"{text}\n"
    assert text.count("black box of") == 1
    assert text.endswith(f"5 recordings and 1 black box, 6.0 MB in {home}")


async def test_what_is_kept_no_ring_takes(home):
    code, text = await said("keep", DRIVE.format(4))
    kept = home / "simulated" / "sim" / "kept" / DRIVE.format(4)
    assert (code, text) == (0, f"kept: {kept}")
    assert [entry.number for entry in entries(home / "simulated" / "sim")] == [5]
    trim(home / "simulated" / "sim", 0)
    assert kept.is_file()
    assert not entries(home / "simulated" / "sim")
    assert keep(kept) == kept, "once more is harmless"
    _, text = await said("list", "--local")
    assert f"simulated/sim/kept/{DRIVE.format(4)}" in text


async def test_trimming_here_takes_of_every_ring_and_nothing_that_is_kept(home):
    await said("keep", f"car1/{DRIVE.format(2)}")
    await said("trim", "--keep-mb", 0, "--local")
    left = [path.name for folder in folders(home) for path in folder.glob("*.mcap")]
    assert left == [DRIVE.format(2)]


async def test_what_is_not_here_cannot_be_kept(home):
    with pytest.raises(ConnectionProblemError, match="no such file here"):
        await said("keep", DRIVE.format(9))


def test_one_cars_ring_does_not_reach_into_anothers(home):
    trim(home / "simulated" / "sim", 0)
    assert [entry.number for entry in entries(home / "car1")] == [2, 3]


def test_replay_and_report_take_a_recording_by_its_listed_and_by_its_bare_name(home, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, here = Path(DRIVE.format(4)), home / "simulated" / "sim" / DRIVE.format(4)
    assert found(name) == found(Path("simulated/sim") / name) == found(here) == here
    assert found(Path("nothing.mcap")) == Path("nothing.mcap"), "left for the reader to refuse"
    (tmp_path / "simulated" / "sim").mkdir(parents=True)
    for place in (name, Path("simulated/sim") / name):
        (tmp_path / place).touch()
        assert found(place) == place, "a file here goes before a listed one"


async def test_an_odd_entry_or_folder_is_named_and_the_rest_is_listed_and_trimmed(home, monkeypatch):
    odd = home / "car1" / DRIVE.format(2)
    odd.unlink()
    odd.mkdir()
    (home / "car0").mkdir()

    def entries_but_of_car0(folder):
        if folder.name == "car0":
            raise PermissionError(13, "Permission denied")
        return entries(folder)

    monkeypatch.setattr("wallride.clients.logs.entries", entries_but_of_car0)
    monkeypatch.setattr("wallride.runtime.recording.ring.entries", entries_but_of_car0)
    code, text = await said("list", "--local")
    assert code == 0
    assert f"car1/{DRIVE.format(2)}   unreadable" in text
    assert f"{home / 'car0'}: cannot be read: Permission denied" in text
    assert text.endswith(f"5 recordings, 4.0 MB in {home}")
    monkeypatch.undo()
    monkeypatch.setenv("XDG_DATA_HOME", str(home.parent.parent))
    code, text = await said("trim", "--local", "--keep-mb", "0")
    assert code == 0
    assert f"not deleted {DRIVE.format(2)}: Is a directory" in text
    assert text.count("\ndeleted ") + text.startswith("deleted ") == 4
    assert (await said("trim", "--local", "--keep-mb", "0"))[0] == 1, "nothing was deleted, and not for want of wishing"


async def test_a_folder_that_is_not_there_is_no_empty_one(home):
    with pytest.raises(ConnectionProblemError, match=r"nope: no such folder"):
        await said("list", "--local", home / "nope")
