"""`wallride param race`: map and law into the car's file, and the car starts anew; or a refusal, and the file stays."""

import time

import pytest

from tests.clients.speaking_car import CarSession
from tests.runtime.test_line_files import in_the_box
from tests.runtime.test_map_files import box, write
from tests.typed import typed
from wallride.clients import race_along
from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.parameters import file as settings_file
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.runtime.tasks.parameters import serve

FILE = '[car]\nmax_speed_mps = 3.0\n\n[wall_follow]\nmethod = "ball"  # mine\n'


class Car(CarSession):
    """A car's desks on a session of their own. drives: why it may not restart. fails: what is wrong with its files."""

    def __init__(self):
        super().__init__()
        self.drives, self.fails, self.restarts = "", "", 0
        context = ServerContext(lambda *_: None, lambda: True, lambda: 1e9, lambda: "a day")
        self.desk = ParameterServer(Settings(), context, ChangeHistory(10))

    def check(self):
        if self.fails:
            raise UnacceptableError(self.fails)

    def begin(self):
        self.restarts += 1

    def serve(self):
        serve(self.bus, "car1", self.desk, RestartDesk(lambda: self.drives, self))

    async def race(self, *words):
        return await race_along.run(typed("param", "race", *words, "--connect", self.endpoint))


@pytest.fixture
def made(tmp_path):
    """A map with its race line, of 5 m/s at most."""
    map_ = write(tmp_path, box())
    (tmp_path / "lab.yaml").write_text("# a map of a.mcap, good\n" + map_.read_text())
    (tmp_path / "lab.line.csv").write_text(in_the_box(5.0))
    return tmp_path / "lab.yaml"


async def test_a_car_that_stands_gets_map_and_law_and_starts_anew(made, car_toml, capsys):
    async with Car() as car:
        assert await car.race(made, "--config", car_toml, "--speed", "4.5") == 0
    assert car.restarts == 1
    settings = load_settings(car_toml)
    assert (settings.map.file, settings.wall_follow.method) == (str(made), "line")
    assert settings.wall_follow.speed_mps == 4.5
    assert 'method = "line"  # mine' in car_toml.read_text()
    said = capsys.readouterr().out
    assert "The car starts anew, disarmed." in said
    assert "at most 3 m/s, and the line has 5.0 m/s" in said


async def test_a_car_that_drives_is_refused_and_its_file_stays(made, car_toml):
    async with Car() as car:
        car.drives = "only while the car stands; stop it first"
        with pytest.raises(ConnectionProblemError, match=r"^no restart: only while the car stands; stop it first$"):
            await car.race(made, "--config", car_toml)
    assert (car_toml.read_text(), car.restarts) == (FILE, 0)


async def test_a_car_that_would_not_start_goes_on_and_says_why(made, car_toml, capsys):
    async with Car() as car:
        car.fails = "no restart: the car would not start: no map file"
        assert await car.race(made, "--config", car_toml) == 0
    assert car.restarts == 0
    assert "systemctl restart wallride (no restart: the car would not start: no map file)" in capsys.readouterr().out


async def test_a_car_that_does_not_answer_after_the_write_has_its_file_told(made, car_toml, capsys, monkeypatch):
    monkeypatch.setattr(race_along, "SAVED_WITHIN_S", 0.5)
    async with Car() as car:
        car.check = lambda: time.sleep(1.0)
        assert await car.race(made, "--config", car_toml) == 0
    said = capsys.readouterr().out
    assert f"{car_toml}: map.file" in said
    assert "systemctl restart wallride (car1 does not answer param/restart" in said


async def test_of_two_who_write_at_once_none_is_told_the_other_s_speed(made, car_toml):
    other = {"wall_follow.speed_mps": 5.0}
    async with Car() as car:
        car.check = lambda: settings_file.save(car_toml, other, other)
        with pytest.raises(ConnectionProblemError, match=r"another program just now, .* wall_follow\.speed_mps = 5"):
            await car.race(made, "--config", car_toml, "--speed", "4")


async def test_a_map_without_a_line_and_another_car_s_file_are_named(made, car_toml, tmp_path):
    async with Car() as car:
        with pytest.raises(ConnectionProblemError, match=r"other.line.csv: .* make it: wallride line"):
            await car.race(tmp_path / "other.yaml", "--config", car_toml)
        with pytest.raises(ConnectionProblemError, match="--config FILE"):
            await car.race(made)
        car_toml.write_text('[car]\nname = "car2"\n')
        with pytest.raises(ConnectionProblemError, match=r"is of another car: car\.name is car2 in it, and car1"):
            await car.race(made, "--config", car_toml)
    assert car.restarts == 0


async def test_a_refused_map_is_not_raced_along(made, car_toml):
    made.write_text("# map by wallride of a.mcap, refused: the ring is open\nimage: lab.pgm\n")
    async with Car() as car:
        with pytest.raises(ConnectionProblemError, match=r"lab\.yaml: the map is refused: the ring is open; drive"):
            await car.race(made, "--config", car_toml)
    assert car.restarts == 0
    assert car_toml.read_text() == FILE


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("m.pgm", "P5 9 9 255 ", r"m\.pgm: says 9 x 9 cells and holds 0"),
        ("lab.walls.csv", "9; 9; 1; 0\n", r"lab\.walls\.csv: these are not the walls"),
        ("lab.line.csv", in_the_box(shift=0.9), r"lab\.line\.csv: the line leads through"),
    ],
)
async def test_a_map_with_which_the_car_would_not_start_is_not_written(made, car_toml, file, text, said):
    (made.parent / file).write_text(text)
    async with Car() as car:
        with pytest.raises(ConnectionProblemError, match=said):
            await car.race(made, "--config", car_toml)
    assert car.restarts == 0
    assert car_toml.read_text() == FILE
