"""Questions to the desk: answered, refused with a reason, or counted as nonsense; never more than bounded work."""

import asyncio
import functools
import itertools
import json
import math
import random
import re
import time

import pytest

from tests.promises import promise
from wallride.runtime.parameters.catalogue import Parameter, catalogue
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.policy import Effect, only_on_the_car
from wallride.runtime.parameters.requests import MAX_QUESTION
from wallride.runtime.parameters.server import MAX_REFUSAL, ParameterServer, ServerContext
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.settings.tree import Settings, load_settings

KP = "wall_follow.kp"


@pytest.fixture
def file(tmp_path):
    """A settings file with nothing in it."""
    (tmp_path / "car.toml").touch()
    return tmp_path / "car.toml"


class Room:
    """A desk in a car that does what is asked of it, and a clock that goes on by a second at every look."""

    def __init__(self, file=None, *, may_loosen=False, **sections):
        self.settings = Settings.model_validate(sections)
        self.standing = False
        self.applied = []
        self.now_s = 0.0
        self.step_s = 1.0
        car = ServerContext(self._apply, lambda: self.standing, self._clock, lambda: "a day", file, may_loosen)
        self.desk = ParameterServer(self.settings, car, ChangeHistory(100))

    def _clock(self):
        self.now_s += self.step_s
        return self.now_s

    def _apply(self, settings, changed):
        self.applied.append((settings, list(changed)))

    def set(self, by="me", **wishes):
        payload = {"values": {name.replace("__", "."): value for name, value in wishes.items()}, "by": by}
        return json.loads(self.desk.set_some(json.dumps(payload).encode()))

    def get(self, *names):
        return json.loads(self.desk.get_some(json.dumps({"names": names}).encode()))["values"]

    def save(self, **wishes):
        payload = {"values": {name.replace("__", "."): value for name, value in wishes.items()}}
        asked = self.desk.configure(json.dumps(payload).encode()) if wishes else self.desk.save(b"{}")
        return json.loads(asyncio.run(asked))

    def history(self):
        return json.loads(self.desk.past(b""))["changes"]

    def refusal(self, **wishes):
        before = self.desk.settings
        with pytest.raises(UnacceptableError) as caught:
            self.set(**wishes)
        assert self.desk.settings is before
        assert not self.applied
        return str(caught.value)


def test_the_list_tells_everything_about_each_setting():
    room = Room()
    found = {entry["name"]: entry for entry in json.loads(room.desk.list_all(b""))["parameters"]}
    assert found[KP]["value"] == found[KP]["default"] == 13.5
    assert (found[KP]["lowest"], found[KP]["highest"], found[KP]["unit"]) == (0, 20, "rad/m")
    assert found["car.wheelbase_m"]["takes_effect"] == "restart"
    only = json.loads(room.desk.list_all(b'{"under": "safety.recovery."}'))["parameters"]
    assert {entry["name"].rpartition(".")[0] for entry in only} == {"safety.recovery"}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        (KP, math.nan, "wall_follow.kp: must be a number from 0 to 20 rad/m"),
        (KP, -math.inf, "wall_follow.kp: must be a number from 0 to 20 rad/m"),
        ("wall_follow.side", None, "wall_follow.side: must be 'left' or 'right'"),
        ("wall_follow.kq", math.nan,
         "wall_follow.kq: must be true, false, a finite number, a text, or a list of texts"),
    ],
)  # fmt: skip
def test_what_is_no_value_is_refused_with_what_the_setting_takes(name, value, words):
    assert Room().refusal(**{name: value}) == words


def test_what_is_set_is_applied_once_and_remembered():
    room = Room()
    said = room.set(wall_follow__kp=0.5, wall_follow__kd=4.5, by="ann")
    assert said["changed"] == [{"name": KP, "old": 13.5, "new": 0.5}]
    assert said["unsaved"] == [KP]
    assert [changed for _, changed in room.applied] == [[KP]]
    assert room.get(KP, "wall_follow.kd") == {KP: 0.5, "wall_follow.kd": 4.5}
    (change,) = room.history()
    assert (change["by"], change["at"], change["name"], change["old"], change["new"]) == ("ann", "a day", KP, 13.5, 0.5)


def test_setting_what_is_already_so_changes_nothing():
    room = Room()
    assert room.set(wall_follow__kp=13.5)["changed"] == []
    assert (room.applied, room.history()) == ([], [])


def test_one_wrong_value_refuses_all_of_them():
    room = Room()
    assert "kd = 99" in room.refusal(wall_follow__kp=0.5, wall_follow__kd=99)
    assert room.get(KP) == {KP: 13.5}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        *((name, 21, f"takes effect after a restart; save it and restart.*wallride param save {name}=")
          for name in ("recording.after_s", "parameters.history")),
        *((name, 21.0 if name == "mux.tick_hz" else 1.5, "edit the file on the car")
          for name in ("motor.brake_current_a", "lidar.silent_after_s", "mux.tick_hz")),
        ("operator.permit", "always", "after a restart"),
    ],
)  # fmt: skip
def test_what_takes_effect_at_the_start_is_refused_with_the_way_to_do_it(name, value, words):
    assert re.search(words, Room().refusal(**{name: value}))


@pytest.mark.parametrize("name", ["wall_follow__method", "safety__method"])
def test_a_law_is_exchanged_only_while_the_car_stands(name):
    room = Room()
    assert "only while the car stands" in room.refusal(**{name: "report"})
    room.standing = True
    assert room.set(**{name: "report"})["changed"]


@pytest.mark.parametrize(
    ("name", "looser", "stricter"),
    [
        ("safety__grip_mu", 0.9, 0.7),
        ("safety__side_margin_m", 0.03, 0.05),
        ("safety__expires_after_s", 0.2, 0.1),
        ("safety__recovery__tries", 8, 2),
        ("car__max_speed_mps", 5.0, 3.0),
    ],
)
def test_a_limit_may_be_tightened_but_not_loosened_while_driving(name, looser, stricter):
    assert "loosens safety while the car drives" in Room().refusal(**{name: looser})
    assert Room().set(**{name: stricter})["changed"]
    assert Room(may_loosen=True).set(**{name: looser})["changed"]
    standing = Room()
    standing.standing = True
    assert standing.set(**{name: looser})["changed"]


def test_binding_the_human_is_allowed_while_driving_and_letting_him_loose_is_not():
    assert Room().set(safety__binds_teleop=True)["changed"]
    assert "loosens" in Room(safety={"binds_teleop": True}).refusal(safety__binds_teleop=False)


def test_a_loosening_does_not_hide_among_others():
    assert "safety.grip_mu" in Room().refusal(wall_follow__kp=1.0, safety__hold_s=0.3, safety__grip_mu=0.9)


def test_without_a_file_nothing_can_be_saved():
    with pytest.raises(UnacceptableError, match="without a settings file"):
        Room().save()


def test_what_was_set_is_saved_and_nothing_else(file):
    file.write_text("# mine\n[wall_follow]\nkp = 0.4  # by hand\n")
    room = Room(file, wall_follow={"kp": 0.4, "side": "right"})
    assert room.save()["saved"] == []
    room.set(wall_follow__kp=0.5)
    assert room.save()["saved"] == [KP]
    assert file.read_text() == "# mine\n[wall_follow]\nkp = 0.5  # by hand\n", "--set side=right is not saved"
    assert room.save()["saved"] == []
    assert room.set(wall_follow__kd=1.0)["unsaved"] == ["wall_follow.kd"]


def test_what_was_set_back_needs_no_saving(file):
    room = Room(file, wall_follow={"kp": 0.4})
    room.standing = True
    assert room.set(wall_follow__kp=0.5)["unsaved"] == [KP]
    assert room.set(wall_follow__kp=0.4)["unsaved"] == []
    before = room.get("safety.method", "safety.grip_mu")
    assert len(room.set(safety__method="report")["unsaved"]) > 1
    assert room.set(**{name.replace(".", "__"): value for name, value in before.items()})["unsaved"] == []
    room.set(wall_follow__kp=0.5)
    room.save()
    assert room.set(wall_follow__kp=0.4)["unsaved"] == [KP], "the file has the other one now"


def test_what_takes_effect_after_a_restart_can_be_saved(file):
    file.write_text("[car]\nname = 'bob'\n")
    room = Room(file, car={"name": "bob"})
    said = room.save(parameters__history=32)
    assert said["after_restart"] == [{"name": "parameters.history", "old": 100, "new": 32}]
    assert load_settings(file).parameters.history == 32
    assert room.desk.settings.parameters.history == 100
    room.save(parameters__history=100)
    assert load_settings(file).parameters.history == 100, "also when it is what the running car has"
    with pytest.raises(UnacceptableError, match="without a restart"):
        room.save(wall_follow__kp=0.5)
    with pytest.raises(UnacceptableError, match="from 1 to 1000"):
        room.save(parameters__history=0)


AFAR = {
    "operator.permit": "always",
    "operator.loosen_safety_while_driving": True,
    "operator.expiry_s": 0.5,
    "car.front_m": 0.4,
    "car.name": "eve",
    "motor.speed_to_erpm_gain": 200.0,
    "motor.address": "serial:///dev/other",
    "lidar.address": "tcp://10.0.0.1:10940",
    "mux.tick_hz": 20.0,
    "telemetry.keys_dir": "/tmp",
    "telemetry.listen": ["tls/[::]:7448"],
    "telemetry.enabled": False,
    "recording.folder": "/etc",
    "recording.enabled": False,
    "recording.ring_mb": 16,
    "recording.keep_free_mb": 10**6,
    "recording.black_box_s": 0.0,
    "process.state_folder": "/etc",
    "parameters.history_file": "/etc/passwd",
}


@pytest.mark.parametrize("name", AFAR)
async def test_what_describes_the_car_and_who_may_drive_it_is_never_saved_from_afar(file, name):
    room = Room(file)
    payload = json.dumps({"values": {"parameters.history": 32, name: AFAR[name]}}).encode()
    with pytest.raises(UnacceptableError, match=f"^{name} .* is not saved from afar: edit .*car.toml on the car"):
        await room.desk.configure(payload)
    with pytest.raises(UnacceptableError, match="not a question"):
        await room.desk.save(payload)
    assert file.read_text() == ""


def test_every_setting_that_a_person_saves_from_afar_is_listed_here():
    known = catalogue(Settings())
    free = {name for name, one in known.items() if one.effect is Effect.RESTART and not only_on_the_car(name)}
    assert free == {
        "log.format", "process.rehearse", "process.stay_awake", "parameters.history",
        "recording.start", "recording.file_mb", "recording.after_s", "recording.raw",
    }  # fmt: skip


def test_a_new_method_is_saved_with_all_that_belongs_to_it(file):
    file.write_text("[wall_follow]\nkp = 0.3\nlook_ahead_m = 0.5\n\n[safety.recovery]\ntries = 2\n")
    room = Room(file, wall_follow={"kp": 0.3, "look_ahead_m": 0.5}, safety={"recovery": {"tries": 2}})
    room.standing = True
    room.set(wall_follow__method="report", safety__method="report")
    room.save()
    saved = load_settings(file)
    assert (saved.wall_follow, saved.safety) == (room.desk.settings.wall_follow, room.desk.settings.safety)


def test_a_file_that_names_another_law_than_the_one_that_was_tuned_is_left_alone(file):
    file.write_text("[wall_follow]\nmethod = 'report'\n")
    room = Room(file)
    room.set(wall_follow__kp=0.5)
    with pytest.raises(UnacceptableError, match=r"wall_follow.method is report, and the car drives with ball"):
        room.save()
    assert file.read_text() == "[wall_follow]\nmethod = 'report'\n"


async def test_one_save_at_a_time(file):
    room = Room(file)
    room.set(wall_follow__kp=0.5)
    first, second = await asyncio.gather(room.desk.save(b""), room.desk.save(b""), return_exceptions=True)
    assert isinstance(first, bytes)
    assert json.loads(first)["saved"] == [KP]
    assert "under way" in str(second)


async def test_what_is_set_during_a_save_is_not_taken_for_saved(file):
    room = Room(file)
    room.set(wall_follow__kp=0.5)
    saving = asyncio.create_task(room.desk.save(b""))
    await asyncio.sleep(0)
    assert room.set(wall_follow__kp=0.6)["unsaved"] == [KP]
    await saving
    assert load_settings(file).wall_follow.kp == 0.5
    assert json.loads(await room.desk.save(b""))["saved"] == [KP]
    assert load_settings(file).wall_follow.kp == 0.6


def test_who_it_was_is_printable_and_short():
    room = Room()
    room.set(wall_follow__kp=0.5, by="a\x1b[2J\nb")
    room.set(wall_follow__kp=0.6, by="")
    assert [change["by"] for change in room.history()] == ["a[2Jb", "unnamed"]


def test_the_list_is_made_anew_only_when_a_value_changed(monkeypatch):
    room = Room()
    described, describe = [], Parameter.describe

    def counted(one, now):
        described.append(one.name)
        return describe(one, now)

    monkeypatch.setattr(Parameter, "describe", counted)
    first = room.desk.list_all(b"")
    made = len(described)
    assert made > 100
    assert room.desk.list_all(b"") == first
    assert len(described) == made
    room.set(wall_follow__kp=0.5)
    kp = next(one for one in json.loads(room.desk.list_all(b""))["parameters"] if one["name"] == KP)
    assert kp["value"] == 0.5


def malformed(chance):
    """Return one thing that is no question to anybody, of many kinds."""
    kinds = [
        lambda: chance.randbytes(chance.randrange(1, 200)),
        lambda: b"{" * chance.randrange(1, MAX_QUESTION),
        lambda: b"[" * MAX_QUESTION,
        lambda: json.dumps({"values": {KP: [[1]]}}).encode(),
        lambda: json.dumps({"values": {KP: {"a": 1}}, "by": "x" * chance.randrange(25, 99)}).encode(),
        lambda: json.dumps({"values": [KP, chance.random()]}).encode(),
        lambda: json.dumps({"names": chance.randrange(9)}).encode(),
        lambda: b'{"values": {"wall_follow.kp": NaN}, "by": 3}',
        lambda: b'{"values": {"wall_follow.kp": 1e999}, "by": null}',
        lambda: b'{"names": ["' + b"\\ud800" * chance.randrange(1, 90) + b'"], "most": -1}',
        lambda: json.dumps({str(number): number for number in range(chance.randrange(1, 200))}).encode(),
        lambda: json.dumps({"values": {str(number): 1 for number in range(65)}, "names": []}).encode(),
        lambda: b'{"by": "' + bytes([chance.randrange(128, 256)]) + b'"}',
        lambda: b"\x00" * chance.randrange(1, 64),
        lambda: json.dumps({"names": ["x" * 65], "values": {"y" * 65: 1}, "under": "z" * 65, "most": 0}).encode(),
        lambda: chance.choice([b"null", b"true", b"3", b'"a"', b"[]", b"NaN", b"-", b'{"a":', b"{}{}"]),
        lambda: b"9" * chance.randrange(1, MAX_QUESTION),
        lambda: bytes(chance.randrange(MAX_QUESTION + 1, MAX_QUESTION * 4)),
    ]
    return chance.choice(kinds)()


@functools.cache
def many_malformed():
    chance = random.Random(4)
    return [malformed(chance) for _ in range(4_000)]


NO_NAMES = (KP, "safety.grip_mu", "car.name", "wall_follow.side", "nothing", "a.b.c", "", "mux.order", ".")
NO_VALUES = (99, -1, True, "", "\ud800", 1e308, 10**300, [], ["a"], -0.5, "NaN", "x" * 256)
"""Well-formed names and values, of which each pair is refused."""


@pytest.mark.parametrize("what", ["list_all", "get_some", "set_some", "save", "configure", "past"])
def test_thousands_of_malformed_questions_are_counted_and_refused(what):
    room = Room()
    ask = getattr(room.desk, what)
    longest_s = 0.0
    for payload in many_malformed():
        began_s = time.thread_time()
        try:
            answer = ask(payload)
            if what in {"save", "configure"}:
                answer.send(None)
        except UnacceptableError as error:
            assert 0 < len(str(error)) <= MAX_REFUSAL  # noqa: PT017 - every one of them is refused
        else:
            raise AssertionError(payload)
        longest_s = max(longest_s, time.thread_time() - began_s)
    assert room.desk.counts.malformed == 4_000
    assert (room.applied, room.desk.counts.answered) == ([], 0)
    promise("the slowest request, processor time", longest_s, 0.05)


def test_wishes_that_cannot_be_granted_change_nothing():
    room = Room()
    for name, value in itertools.product(NO_NAMES, NO_VALUES):
        with pytest.raises(UnacceptableError) as caught:
            room.desk.set_some(json.dumps({"values": {name: value}}).encode())
        str(caught.value).encode()
        assert len(str(caught.value)) <= MAX_REFUSAL
    assert (room.applied, room.history()) == ([], [])


@pytest.mark.parametrize("length", [MAX_QUESTION + 1, 50_000_000])
def test_a_huge_question_is_not_even_read(length):
    room = Room()
    payload = bytes(length)
    began_s = time.thread_time()
    with pytest.raises(UnacceptableError, match=f"{length} bytes are too long"):
        room.desk.set_some(payload)
    promise("refusing a request by its length, processor time", time.thread_time() - began_s, 0.01)
