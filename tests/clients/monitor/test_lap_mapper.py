"""The map of a lap from a page: what is run, told, refused and written, with commands that compute nothing."""

import asyncio
import contextlib

import pytest

from tests.clients.monitor.lap_commands import NAME, OPEN, PNG, LapCommands, listing, recorded
from tests.waiting import until
from wallride.clients.monitor.lap_mapper import LapMapper, LapSource
from wallride.clients.monitor.messages import MapLap
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.wire.network import RefusedError

CAR = {
    "car.name": "car1", "recording.simulated": False, "car.wheelbase_m": 0.25, "car.max_steering_rad": 0.4,
    "car.max_acceleration_mps2": 3.0, "car.half_width_m": 0.14,
}  # fmt: skip
FILE = """# the car
[car]
name = "car1"
wheelbase_m = 0.25  # by ruler

[wall_follow]
method = "ball"  # or "report"
kp = 12.0
"""


class Bench:
    """A mapper with a car that answers, and commands that answer. settings: what the car says of itself."""

    def __init__(self, recordings, config=None):
        self.recordings = recordings
        self.settings = dict(CAR)
        self.commands = LapCommands()
        self.asked, self.refusals = [], []
        self.mapper = LapMapper(config, self.commands)

    def source(self, car="car1", objection=""):
        return LapSource(car, self.answer, ["--connect", "tcp/car1.local:7447"], objection)

    async def answer(self, what, question):
        if what == "logs/list":
            return self.recordings
        if what == "param/restart":
            self.asked.append(question)
            if self.refusals and (refusal := self.refusals.pop(0)):
                raise RefusedError(refusal)
            return {"restarts": not question.get("only_ask", False)}
        return {"values": {name: self.settings[name] for name in question["names"]}}

    def press(self, do="begin", speed_mps=None, **more):
        self.mapper.receive(MapLap(t="map_lap", do=do, speed_mps=speed_mps), self.source(**more))

    async def ended(self):
        """Wait for the end of what was begun; return the page's fields."""
        await until(lambda: not self.mapper.is_busy)
        await asyncio.sleep(0)
        return self.mapper.fields("car1")

    async def made(self):
        self.press()
        return await self.ended()

    async def raced(self, **more):
        self.press("race", **more)
        return await self.ended()


@pytest.fixture
def abroad(tmp_path):
    """A mapper on a computer with the recordings and without the car's file."""
    return Bench(recorded(tmp_path / "recordings"))


@pytest.fixture
def bench(abroad, car_toml):
    """A mapper on the car itself."""
    return Bench(abroad.recordings, car_toml)


async def test_the_newest_recording_of_a_car_here_becomes_a_map_with_its_line(bench, tmp_path, car_toml):
    now = await bench.made()
    target = car_toml.parent / "maps" / "car1" / NAME.replace(".mcap", ".yaml")
    line = target.with_name(NAME.replace(".mcap", ".line.csv"))
    assert bench.commands.words == [
        ["map", str(tmp_path / "recordings" / NAME), "-o", str(target), "--json", "-"],
        ["line", str(target), "-o", str(line), "--set", "car.wheelbase_m=0.25", "--set", "car.max_steering_rad=0.4",
         "--set", "car.max_acceleration_mps2=3.0", "--set", "car.half_width_m=0.14", "--json", "-"],
    ]  # fmt: skip
    assert (now["stage"], now["can_be_raced"], now["busy"]) == ("good", True, False)
    assert now["words"][0] == "The map is good."
    assert "14 edges close the loop, 9 of them in all directions" in now["words"][1]
    assert now["words"][2] == "The race line: 28.1 m, 6.77 s a lap in theory, 2.1 to 6.0 m/s."
    assert now["pictures"] == ["map", "line"]
    assert [bench.mapper.picture(name) for name in ("map", "line", "../car")] == [PNG, PNG, None]


async def test_race_along_it_keeps_map_and_law_in_the_car_s_file(bench, car_toml):
    await bench.made()
    now = await bench.raced()
    assert now["stage"] == "saved"
    assert bench.asked == [{"only_ask": True}, {}], "first whether it stands"
    assert now["words"][1].startswith("The car starts anew, disarmed. Carry it to where the lap began, and permit it")
    assert "at most 4 m/s, and the line has 6.0 m/s" in now["words"][2], "of car.max_speed_mps"
    settings = load_settings(car_toml)
    assert settings.map.file == str(car_toml.parent / "maps" / "car1" / NAME.replace(".mcap", ".yaml"))
    assert (settings.wall_follow.method, settings.wall_follow.kp, settings.map.line) == ("line", 12.0, "")
    assert settings.wall_follow.speed_mps == 6.0, "the line's"
    assert 'method = "line"  # or "report"' in car_toml.read_text()
    with pytest.raises(RefusedError, match="make it first"):
        bench.press("race")


async def test_a_race_that_was_begun_is_not_cancelled(bench, car_toml):
    await bench.made()
    bench.press("race")
    bench.press("cancel")
    assert (await bench.ended())["stage"] == "saved"
    assert load_settings(car_toml).wall_follow.method == "line"


async def test_a_car_that_drives_is_told_by_name_and_its_file_stays(bench, car_toml):
    await bench.made()
    bench.refusals = ["no restart: only while the car stands; stop it first"]
    now = await bench.raced(speed_mps=3.0)
    said = "no restart: only while the car stands; stop it first"
    assert (now["stage"], now["is_refused"], now["can_be_raced"], now["words"][0]) == ("good", True, True, said)
    assert car_toml.read_text() == FILE


async def test_of_two_refusals_only_the_last_is_told(bench):
    about = (await bench.made())["words"]
    bench.refusals = ["no restart: the e-stop is on", "car1 does not answer"]
    for refusal in bench.refusals.copy():
        assert (await bench.raced())["words"] == [refusal, *about]
    assert (await bench.raced())["stage"] == "saved"


async def test_a_car_that_does_not_start_itself_anew_is_for_a_hand(bench, car_toml):
    await bench.made()
    bench.refusals = ["", 'no restart: operator.permit = "always"']
    now = await bench.raced(speed_mps=3.0)
    assert now["stage"] == "saved"
    assert 'sudo systemctl restart wallride (no restart: operator.permit = "always")' in now["words"][1]
    assert load_settings(car_toml).wall_follow.speed_mps == 3.0


async def test_a_line_of_another_map_is_not_kept(bench, car_toml):
    car_toml.write_text(FILE + '\n[map]\nfile = "old.yaml"\nline = "old.line.csv"\n')
    await bench.made()
    await bench.raced()
    assert load_settings(car_toml).map.line == ""


async def test_an_open_ring_is_refused_with_its_reason_and_not_raced(bench, car_toml):
    bench.commands.reasons = [OPEN]
    now = await bench.made()
    assert (now["stage"], now["can_be_raced"], now["lines"]) == ("refused", False, "")
    assert now["words"][0] == f"The map is refused: {OPEN}."
    assert bench.commands.names == ["map"]
    assert bench.mapper.picture("map") == PNG, "to look at what is missing"
    with pytest.raises(RefusedError, match="make it first"):
        bench.press("race")
    assert car_toml.read_text() == FILE


@pytest.mark.parametrize(
    ("recordings", "said"),
    [
        (listing("/none"), "car1 has no recording yet: drive a lap"),
        (listing("/none", "../../car.mcap"), "not the name of a recording"),
        ({"files": "none"}, "cannot be read"),
    ],
)
async def test_without_a_recording_nothing_is_run(recordings, said):
    bench = Bench(recordings)
    now = await bench.made()
    assert now["stage"] == "failed"
    assert said in now["words"][0]
    assert bench.commands.words == []


async def test_a_second_press_is_refused_until_the_first_has_ended_or_is_cancelled(abroad):
    abroad.commands.gate.clear()
    abroad.press()
    await until(lambda: abroad.commands.words)
    assert abroad.mapper.fields("car1")["stage"] == "mapping"
    assert abroad.mapper.fields("car2")["words"] == ["A map of car1's lap is being made."]
    for do in ("begin", "race"):
        with pytest.raises(RefusedError, match="is being made: wait for it, or cancel it"):
            abroad.press(do)
    abroad.press("cancel")
    now = await abroad.ended()
    assert (now["stage"], now["words"], now["busy"]) == ("failed", ["Cancelled."], False)
    abroad.commands.gate.set()
    assert (await abroad.made())["stage"] == "good"


async def test_an_objection_to_the_page_comes_before_all(abroad):
    for do in ("begin", "race"):
        with pytest.raises(RefusedError, match="car1 drives: stop it first"):
            abroad.press(do, objection="car1 drives: stop it first")
    assert not abroad.mapper.is_busy


async def test_a_recording_of_another_computer_is_fetched_and_its_map_goes_by_hand(tmp_path, data):
    bench = Bench(listing(tmp_path / "not here", NAME))
    now = await bench.made()
    assert bench.commands.names == ["logs", "map", "line"]
    fetch, made, _ = bench.commands.words
    assert fetch[:-1] == ["logs", "get", NAME, "--car", "car1", "--connect", "tcp/car1.local:7447", "-o"]
    assert made[1] == f"{fetch[-1]}/car1/{NAME}"
    stem = data / "maps" / "car1" / NAME.replace(".mcap", "")
    assert now["words"][-1].startswith(f"Copy {stem}.* to /var/lib/wallride on the car. Put these lines into")
    assert now["lines"] == (f'[map]\nfile = "/var/lib/wallride/{stem.name}.yaml"\n\n[wall_follow]\nmethod = "line"')
    assert not now["can_be_raced"]


async def test_a_fetch_that_fails_says_why(tmp_path):
    bench = Bench(listing(tmp_path / "not here", NAME))
    bench.commands.failing["logs"] = (2, "wallride: car1 does not answer logs/get\n")
    now = await bench.made()
    assert now["words"] == ["The recording did not come over: car1 does not answer logs/get"]


async def test_without_the_car_s_file_the_lines_are_shown(abroad, data):
    now = await abroad.made()
    assert now["lines"].startswith(f'[map]\nfile = "{data}/maps/car1/')
    assert "Copy" not in now["words"][-1]


async def test_another_car_s_file_is_not_written(bench, car_toml):
    bench.settings["car.name"] = "car2"
    now = await bench.made()
    assert not now["can_be_raced"]
    assert f"{car_toml} is of another car: car.name is car1 in it, and car2 on this car" in now["words"]


async def test_a_simulated_car_races_by_the_simulator(bench, data):
    bench.settings["recording.simulated"] = True
    now = await bench.made()
    made = data / "maps" / "car1" / NAME.replace(".mcap", ".yaml")
    assert now["lines"] == f"wallride sim --race {made} --laps 5"


async def test_a_map_without_a_line_is_good_and_not_raced(bench):
    bench.commands.failing["line"] = (2, "wallride: there is no room for the car at x 1.0 m, y 2.0 m\n")
    now = await bench.made()
    assert (now["stage"], now["can_be_raced"], now["pictures"]) == ("good", False, ["map"])
    assert now["words"][-1] == "There is no race line: there is no room for the car at x 1.0 m, y 2.0 m"


@pytest.mark.parametrize("code", [1, 2, -9])
async def test_a_map_command_that_fails_says_why(abroad, code):
    abroad.commands.failing["map"] = (code, "wallride: recordings need scipy: pip install '.[map]' in the clone\n")
    now = await abroad.made()
    assert now["stage"] == "failed"
    assert now["words"] == ["No map was made: recordings need scipy: pip install '.[map]' in the clone"]


async def test_a_file_that_cannot_take_it_stays_as_it_is(bench, car_toml):
    text = FILE.replace('"ball"  # or "report"', '"report"').replace("kp = 12.0", 'corner_rule = "lab2"')
    car_toml.write_text(text)
    await bench.made()
    now = await bench.raced()
    assert now["stage"] == "good", "it can be tried again"
    assert "corner_rule" in now["words"][0]
    assert car_toml.read_text() == text


async def test_the_end_of_the_monitor_ends_a_command(abroad):
    abroad.commands.gate.clear()
    abroad.press()
    await asyncio.sleep(0)
    with contextlib.suppress(asyncio.CancelledError):
        await abroad.mapper.close()
    assert not abroad.mapper.is_busy
