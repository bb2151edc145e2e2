"""Saving settings: the user's text survives, and so does the file, whatever is broken on the way."""

import errno
import itertools
import os
import random
import signal
import stat
import time
from pathlib import Path

import pytest

from tests.full_disk import full_disk
from wallride.runtime.parameters import file as settings_file
from wallride.runtime.parameters.file import MARK, StoreError, marked, merged, replace, save
from wallride.runtime.settings.tree import Settings, load_settings, to_toml

ROOT = Path(__file__).resolve().parents[3]
KP = "wall_follow.kp"
FILE = Path("car.toml")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text((ROOT / "config" / "car.toml").read_text())
    return path


def is_alone(file):
    return [path.name for path in file.parent.iterdir()] == [file.name]


def test_only_the_value_changes_and_comments_and_order_stay(file):
    before = file.read_text().splitlines()
    save(file, {KP: 0.5, "safety.binds_teleop": True}, {KP: 0.5})
    after = file.read_text().splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert changed == [
        ("kp = 13.5                         # steering per metre of distance error, at 1 m/s; falls as 1 / speed^2",
         "kp = 0.5                         # steering per metre of distance error, at 1 m/s; falls as 1 / speed^2"),
        ("binds_teleop = false              # true: the joystick is limited too",
         "binds_teleop = true              # true: the joystick is limited too; saved while the car ran"),
    ]  # fmt: skip
    assert is_alone(file)


@pytest.mark.parametrize(
    ("text", "edits"),
    [
        ("", {KP: 0.5}),
        ("# only words\n", {KP: 0.5, "safety.recovery.tries": 2}),
        ("wall_follow.kd = 1.0\n", {KP: 0.5}),
        ("wall_follow = { kd = 1.0 }\n", {KP: 0.5, "wall_follow.side": "right"}),
        ("[safety.recovery]\ntries = 1\n[safety]\nhold_s = 0.3\n", {"safety.recovery.tries": 2, "safety.hold_s": 0.4}),
        ("[safety]\nhold_s = 0.3\n[car]\nname='a'\n[safety.recovery]\ntries = 1\n", {"safety.grip_mu": 0.7}),
        ("[mux]\norder = [ # mine\n 'e-stop', 'teleop', 'safety',\n 'permit', 'navigation']\n", {"mux.tick_hz": 40.0}),
        ("[wall_follow]\r\nkp = 1\r\n", {KP: 0.1 + 0.2, "car.name": "ab"}),
        ("[log]\nlevel = 'INFO'", {"log.level": "DEBUG", KP: 1e-7}),
        ("[wall_follow]\nkp = 1\nkd = 2\n", {KP: None, "wall_follow.kd": None}),
        ("[safety.recovery]\ntries = 1\n", {"safety.recovery.tries": None}),
        ("[wall_follow]\n", {"safety.recovery.tries": None}),
    ],
)
def test_every_shape_of_file_loads_to_the_new_values(tmp_path, text, edits):
    file = tmp_path / "car.toml"
    file.write_bytes(text.encode())
    load_settings(file)
    save(file, edits, {name: value for name, value in edits.items() if value is not None})
    tree = load_settings(file).model_dump()
    for name, value in edits.items():
        section, *rest = name.split(".")
        found = tree[section]
        for key in rest:
            found = found[key]
        assert value is None or found == value


@pytest.mark.parametrize("text", ["", "[safety]\nhold_s = 0.3\n[car]\nname='a'\n[safety.recovery]\ntries = 1\n"])
def test_a_saved_value_that_bounds_the_car_is_found_at_the_next_start(tmp_path, text):
    file = tmp_path / "car.toml"
    file.write_text(text)
    save(file, {KP: 0.5, "safety.side_margin_m": 0.01, "safety.recovery.tries": 3, "car.max_speed_mps": 9.0}, {})
    found = {"safety.side_margin_m": 0.01, "safety.recovery.tries": 3, "car.max_speed_mps": 9.0}
    assert marked(file) == found, "not kp, which bounds nothing"
    save(file, {"car.max_speed_mps": 8.0}, {})
    assert file.read_text().count(MARK) == 3
    assert marked(file) == {**found, "car.max_speed_mps": 8.0}
    file.write_text(file.read_text().replace(MARK, "looked at"))
    assert marked(file) == {}


@pytest.mark.parametrize("content", [b"", b"\xff", f"[safety # {MARK}".encode()])
def test_a_file_that_cannot_be_read_has_no_such_value(tmp_path, content):
    file = tmp_path / "car.toml"
    assert marked(file) == {}
    file.write_bytes(content)
    assert marked(file) == {}


def test_a_removed_section_leaves_no_empty_header():
    assert "recovery" not in merged("[safety.recovery]\ntries = 1\n", {"safety.recovery.tries": None}, FILE)


def test_everything_printed_can_be_edited():
    text = to_toml(Settings())
    assert merged(text, {KP: 0.5}, FILE) == text.replace("kp = 13.5", "kp = 0.5")


def test_mode_and_owner_stay(file):
    file.chmod(0o640)
    owner = file.stat()
    save(file, {KP: 0.5}, {KP: 0.5})
    now = file.stat()
    assert (stat.S_IMODE(now.st_mode), now.st_uid, now.st_gid) == (0o640, owner.st_uid, owner.st_gid)


def test_an_owner_that_cannot_be_kept_is_a_refusal(file, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: -1)
    monkeypatch.setattr(os, "fchown", failing(errno.EPERM))
    assert_intact(file, "the car's user must own the file")


def test_a_link_to_the_file_stays_a_link(file, tmp_path):
    link = tmp_path / "link.toml"
    link.symlink_to(file)
    save(link, {KP: 0.5}, {KP: 0.5})
    assert link.is_symlink()
    assert load_settings(file).wall_follow.kp == 0.5


def test_what_an_earlier_power_cut_left_behind_is_cleared(file):
    (file.parent / ".car.toml.new").write_text("half of a fi")
    save(file, {KP: 0.5}, {KP: 0.5})
    assert is_alone(file)


def assert_intact(file, *words):
    before = file.read_bytes()
    with pytest.raises(StoreError) as caught:
        save(file, {KP: 0.5}, {KP: 0.5})
    assert file.read_bytes() == before
    message = str(caught.value)
    assert all(word in message for word in [*words, str(file)]), message
    assert "\n" not in message
    assert is_alone(file)


def failing(code):
    def fail(*_, **__):
        raise OSError(code, os.strerror(code))

    return fail


@pytest.mark.parametrize("step", ["open", "write", "fsync", "fchmod", "replace", "stat"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_a_failing_disk_leaves_the_old_file_and_says_why(file, monkeypatch, step, code):
    with monkeypatch.context() as broken:
        broken.setattr(Path if step in {"replace", "stat"} else os, step, failing(code))
        before = file.read_bytes()
        with pytest.raises(StoreError) as caught:
            save(file, {KP: 0.5}, {KP: 0.5})
    assert os.strerror(code) in str(caught.value)
    assert str(file) in str(caught.value)
    assert file.read_bytes() == before
    assert is_alone(file)


def test_a_directory_that_cannot_be_forced_to_the_disk_is_said(file, monkeypatch):
    monkeypatch.setattr(settings_file, "_force_to_disk", failing(errno.EIO))
    with pytest.raises(StoreError, match="saved, but a power cut now may bring the old file back"):
        save(file, {KP: 0.5}, {KP: 0.5})
    assert load_settings(file).wall_follow.kp == 0.5


def test_short_writes_are_written_on(file, monkeypatch):
    write = os.write
    monkeypatch.setattr(os, "write", lambda number, data: write(number, bytes(data[:7])))
    save(file, {KP: 0.5}, {KP: 0.5})
    assert load_settings(file).wall_follow.kp == 0.5


def test_a_full_disk_is_survived_for_real(file):
    """A limit on the size of files makes the kernel write half of it and then refuse, as a full disk does."""
    with full_disk(500):
        assert_intact(file, "File too large")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[wall_follow\n", "not TOML"),
        ("wall_follow = 3\n", "not TOML"),
        ("[wall_follow]\nsped = 3\n", "sped is not a setting"),
        ("[wall_follow]\nkd = 99\n", "wall_follow.kd = 99"),
        ("[wall_follow]\nmethod = 'report'\n", "wall_follow.method is report, and the car drives with ball"),
    ],
)
def test_a_file_that_would_not_start_the_car_as_it_is_tuned_is_left_alone(file, text, words):
    file.write_text(text)
    with pytest.raises(StoreError, match=words):
        save(file, {KP: 0.5}, {KP: 0.5, "wall_follow.method": "ball"})
    assert file.read_text() == text
    assert is_alone(file)


def test_a_file_that_is_gone_or_no_text_is_one_clear_message(file):
    file.write_bytes(b"\xff\xfe")
    assert_intact(file, "cannot be read")
    file.unlink()
    with pytest.raises(StoreError, match="No such file"):
        save(file, {KP: 0.5}, {KP: 0.5})


def test_somebody_who_edits_at_the_same_time_is_not_overwritten(file, monkeypatch):

    def load_while_another_edits(*args, **how):
        file.write_text("[wall_follow]\nkp = 3.0\n")
        return load_settings(*args, **how)

    monkeypatch.setattr(settings_file, "load_settings", load_while_another_edits)
    with pytest.raises(StoreError, match="was changed by another program just now"):
        save(file, {KP: 0.5}, {KP: 0.5})
    assert load_settings(file).wall_follow.kp == 3.0


def test_the_disk_is_told_in_the_right_order(file, monkeypatch):
    """The content is on the disk before the name points to it, and the name is on the disk before success is said."""
    said = []

    def noted(name, call):
        def wrapped(first, *rest, **options):
            kind = "directory" if isinstance(first, int) and stat.S_ISDIR(os.fstat(first).st_mode) else "file"
            said.append(f"{name} {kind}")
            return call(first, *rest, **options)

        return wrapped

    for name in ("write", "fsync"):
        monkeypatch.setattr(os, name, noted(name, getattr(os, name)))
    monkeypatch.setattr(Path, "replace", noted("replace", Path.replace))
    save(file, {KP: 0.5}, {KP: 0.5})
    assert said == ["write file", "fsync file", "replace file", "fsync directory"]


@pytest.mark.parametrize("step", ["open", "fchmod", "write", "fsync", "close", "replace"])
@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_a_process_killed_at_any_step_leaves_the_old_or_the_new_file(file, step, after):
    old = file.read_bytes()
    new = merged(old.decode(), {KP: 0.5}, file).encode()
    ended = in_child(lambda: die_at(step, after=after, then=lambda: save(file, {KP: 0.5}, {})))
    assert os.waitstatus_to_exitcode(ended) == -signal.SIGKILL
    assert file.read_bytes() == (new if (step, after) == ("replace", True) else old)
    save(file, {KP: 0.6}, {KP: 0.6})  # and nothing that was left behind is in the way
    assert is_alone(file)


def test_a_process_killed_at_random_moments_leaves_the_old_or_the_new_file(file):
    one = file.read_bytes()
    other = merged(one.decode(), {KP: 0.5}, file).encode()
    began_s = time.monotonic()
    for kp in (0.5, 13.5):
        save(file, {KP: kp}, {KP: kp})
    takes_s = (time.monotonic() - began_s) / 2
    seen = {one: 0, other: 0}
    chance = random.Random(1)
    for _ in range(40):
        kps = (0.5, 13.5) if file.read_bytes() == one else (13.5, 0.5)
        begun, begins = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.write(begins, b"!")
                for kp in itertools.cycle(kps):
                    save(file, {KP: kp}, {KP: kp})
            finally:
                os._exit(1)
        os.read(begun, 1)  # on a busy machine the child may begin late
        os.close(begun)
        os.close(begins)
        time.sleep(chance.uniform(0.0, 3 * takes_s))  # the kill is the event; its moment is meant to be random
        os.kill(child, signal.SIGKILL)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
        seen[file.read_bytes()] += 1
    assert min(seen.values()) > 3, "both were met, and nothing else, which would be a KeyError"


def in_child(work):
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(1)
    return os.waitpid(child, 0)[1]


def die_at(step, *, after, then):
    owner = Path if step == "replace" else os
    call = getattr(owner, step)

    def dying(*args, **options):
        if not after:
            os.kill(os.getpid(), signal.SIGKILL)
        call(*args, **options)
        os.kill(os.getpid(), signal.SIGKILL)

    setattr(owner, step, dying)
    then()


def test_a_new_file_can_be_written_too(tmp_path):
    replace(tmp_path / "history.jsonl", b"{}\n")
    assert (tmp_path / "history.jsonl").read_bytes() == b"{}\n"


def test_a_default_that_stands_in_the_file_already_keeps_its_line(file):
    save(file, {KP: 0.5}, {KP: 0.5})
    save(file, {KP: 13.5}, {KP: 13.5})
    assert "kp = 13.5                         # steering" in file.read_text()


@pytest.mark.parametrize("name", ["wall_follow.own.gain", "wall_follow.speed_mps"])
def test_values_of_a_law_that_the_file_does_not_name_are_refused_with_the_line_to_write(name, file):
    before = file.read_bytes()
    with pytest.raises(StoreError) as refused:
        save(file, {name: 2.0}, {name: 2.0, "wall_follow.method": "mine:Law"})
    assert str(refused.value) == (
        f"{file}: its wall_follow.method is ball, and the car drives with mine:Law:"
        ' write method = "mine:Law" below [wall_follow] first, then save; nothing was saved'
    )
    assert file.read_bytes() == before
    assert is_alone(file)


@pytest.mark.parametrize("before", [b"a = 1\n", None])
def test_a_full_disk_leaves_what_was_there_and_speaks_of_it_only_where_it_was(before, tmp_path):
    path = tmp_path / "car.toml"
    if before is not None:
        path.write_bytes(before)
    with full_disk(10), pytest.raises(StoreError) as told:
        replace(path, b"x" * 100)
    assert ("the old file is untouched" in str(told.value)) is (before is not None)
    assert [one.read_bytes() for one in tmp_path.iterdir()] == ([before] if before is not None else [])
