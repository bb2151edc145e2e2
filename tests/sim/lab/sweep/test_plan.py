"""Files of sweeps: the runs that they stand for, and their mistakes by file and line."""

from pathlib import Path

import pytest

from wallride.sim.lab.sweep.plan import read_plan
from wallride.sim.scenario.toml_lines import FileMistakeError

EASY = """world = "straight"
duration_s = 1.0
wall_follow.speed_mps = 2.0
"""


@pytest.fixture
def plan_of(tmp_path):
    def read(text):
        (tmp_path / "some.toml").write_text(text)
        return read_plan(tmp_path / "some.toml")

    return read


def check_all(plan_of, text):
    plan = plan_of(text)
    for cell in plan.cells:
        plan.setup_of(cell)


def values(plan, name):
    return [cell.get(name) for cell in plan.cells]


def test_a_grid_is_every_combination_with_every_seed(plan_of):
    plan = plan_of(
        EASY + 'seeds = 2\n[grid]\nlaw = ["ball", "report"]\nwall_follow.desired_distance_m = [0.8, 1.0, 1.2]\n'
    )
    assert len(plan.cells) == 2 * 2 * 3 == len({cell.key for cell in plan.cells})
    assert values(plan, "law") == ["ball"] * 6 + ["report"] * 6
    assert values(plan, "seed") == [0, 1] * 6
    assert set(values(plan, "wall_follow.speed_mps")) == {2.0}
    assert plan.varied == ("law", "wall_follow.desired_distance_m")


def test_random_values_are_the_same_for_every_combination_and_stay_when_others_come(plan_of):
    random = "[random]\nruns = 20\nseed = 3\nvehicle.grip_mu = { from = 0.5, to = 1.0 }\n"
    one = plan_of(EASY + '[grid]\nlaw = ["ball", "report"]\n' + random)
    mus = values(one, "vehicle.grip_mu")
    assert mus[:20] == mus[20:]
    assert len(set(mus)) == 20
    assert all(0.5 <= mu <= 1.0 for mu in mus)
    assert values(one, "seed") == [*range(20), *range(20)]
    more = plan_of(EASY + random.replace("20", "30") + "start.distance_m = [0.5, 1.5]\n")
    assert values(more, "vehicle.grip_mu")[:20] == mus[:20]
    assert set(values(more, "start.distance_m")) == {0.5, 1.5}


def test_random_values_can_be_whole_or_spread_over_magnitudes(plan_of):
    plan = plan_of(
        EASY + "[random]\nruns = 200\n"
        + "wall_follow.kp = { from = 1, to = 100, log = true }\nlidar.beams = { from = 500, to = 502, whole = true }\n"
    )  # fmt: skip
    assert set(values(plan, "lidar.beams")) == {500, 501, 502}
    kps = sorted(values(plan, "wall_follow.kp"))
    assert 5 < kps[100] < 20


def test_the_key_of_a_run_depends_on_its_values_alone(plan_of):
    first = plan_of(EASY)
    assert (
        plan_of("\n# moved\nwall_follow.speed_mps = 2.0\nduration_s = 1.0\nworld = 'straight'\n").cells == first.cells
    )
    assert plan_of(EASY.replace("1.0", "1.5")).cells[0].key != first.cells[0].key
    assert first.cells[0].key == "90a3fd19d95a5f03"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (EASY + "wrold = 'loop'\n", 4, "wrold is unknown; did you mean world"),
        (EASY + "[grid]\nlaw = 'ball'\n", 5, "write a list of values"),
        (EASY + "[grid]\nlaw = ['ball', 'bal']\n", 5, "no law is called 'bal'"),
        (EASY + "[grid]\nwall_follow.kp = [1]\n\nwall_follow.kpp = [1, 2]\n", 7, "wall_follow.kpp is not a setting"),
        (EASY + "[grid]\nwall_follow.kp = [1, -5]\n", 5, "wall_follow.kp = -5"),
        (EASY + "[grid.vehicle]\ngrip_mu = [0.5, 0]\n", 5, "vehicle.grip_mu = 0"),
        (EASY + "[vehicle]\nmass = 3\n", 5, "vehicle.mass = 3: is unknown; there are wheelbase_m"),
        (EASY + "[random]\nruns = 0\nvehicle.grip_mu = [1]\n", 5, "runs = 0"),
        (EASY + "[random]\nruns = 2\nvehicle.grip_mu = { from = 1, to = 0.5 }\n", 6, "LOW below HIGH"),
        (EASY + "[random]\nruns = 2\n", 4, "has no value to vary"),
        (EASY + "seeds = -1\n", 4, "whole numbers from 0 on"),
        (EASY + "[grid]\nworld = ['loop']\n", 5, "world is given twice"),
        (EASY + "[start]\ndistance_m = 0.1\n", 5, "would start in a wall of straight"),
        (EASY + "[grid]\nstart.toward_deg = [0, 'left']\n", 5, "are numbers"),
        (EASY + "obstacles = ['bix at=1,1']\n", 4, "begins with box, pole, person"),
        (EASY + "way_m = -1\n", 4, "way_m = -1: give a number above 0"),
        (EASY.replace("straight", "strait"), 1, "no world is called 'strait'"),
        (EASY.replace("straight", "track:seed=x"), 1, "write track:seed=7"),
        (EASY.replace("straight", "gone.yaml"), 1, "no map file"),
        (EASY + "[grid\n", 4, "is not valid TOML"),
        (EASY + "config = 'gone.toml'\n", 4, "no such file"),
        (EASY + "config = 5\n", 4, "config = 5: write a text"),
        (EASY + "law = 5\n", 4, "law = 5: write a text"),
        (EASY + "law = 'ball'\nwall_follow.method = 'report'\n", 5, "law = 'ball' says it already"),
        (EASY + "obstacles = 'box at=1,1'\n", 4, "write a list of texts"),
        (EASY + "obstacles = 5\n", 4, "write a list of texts"),
        (EASY + "vehicle = 3\n", 4, "vehicle is a table; write vehicle.KEY = VALUE"),
        (EASY + "seeds = 2\nseed = 3\n", 4, "seed and seeds are both given"),
        (EASY + "runs = 10\n", 4, "runs belongs into [random]"),
        (EASY + "[random]\nruns = 2\nseeds = [1, 2]\n", 6, "seeds belongs at the top of the file"),
        (EASY + "vehicle.grip_mu = { from = 0.5, to = 0.8 }\n", 4, "a range belongs into [random]"),
        (EASY + "[random]\nlidar.beams = { from = 9.5, to = 12, whole = true }\n", 5, "needs whole numbers"),
        (EASY + "wall_follow.kp = 2020-01-01\n", 4, "wall_follow.kp is a date or a time"),
        (EASY + "start.distance_m = 200\n", 4, "no wall is within 10 m of the start"),
        (EASY + "lidar.own_parts = 'horns'\n", 4, "lidar.own_parts = 'horns': write one of none, posts"),
        (EASY + "[[grid]]\nlaw = ['ball']\n", 4, "grid is a table; write [grid]"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_file_and_line(plan_of, tmp_path, text, line, words):
    with pytest.raises(FileMistakeError) as caught:
        check_all(plan_of, text)
    assert str(caught.value).startswith(f"{tmp_path / 'some.toml'}:{line}: ")
    assert words in str(caught.value)


def test_a_map_without_its_image_is_told(plan_of, tmp_path):
    (tmp_path / "hall.yaml").write_text("image: gone.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    plan = plan_of(EASY.replace("straight", "hall.yaml"))
    with pytest.raises(FileMistakeError, match=r"some.toml:1: the map's image .*gone.png is missing"):
        plan.setup_of(plan.cells[0])


@pytest.mark.parametrize("file", sorted((Path(__file__).parents[4] / "config" / "sweeps").glob("*.toml")), ids=str)
def test_the_examples_are_sweeps(file):
    plan = read_plan(file)
    assert len(plan.cells) >= 20
    assert all(plan.setup_of(cell).case.duration_s > 0 for cell in plan.cells)
