"""Scenario files: what they make, and their mistakes by file and line."""

import math
from pathlib import Path

import pytest

from wallride.sim.scenario.scenario_file import load_scenario
from wallride.sim.scenario.toml_lines import FileMistakeError, read_toml
from wallride.sim.world.obstacles import Box, ConstantMotion, Round, StandingObstacle, SuddenObstacle
from wallride.sim.world.pose import Pose

EXAMPLES = sorted((Path(__file__).parents[3] / "config" / "scenarios").glob("*.toml"))
assert len(EXAMPLES) >= 5
HEAD = 'world = "corridor"\nduration_s = 5.0\n'


@pytest.fixture
def scenario_of(tmp_path):
    def load(text):
        (tmp_path / "some.toml").write_text(text)
        return load_scenario(tmp_path / "some.toml")

    return load


def test_every_part_of_a_file_is_made(scenario_of):
    scenario = scenario_of(
        'own_parts = "posts"\nseed = 3\n' + HEAD + "[start]\ndistance_m = 0.6\ntoward_deg = 10\n"
        "[settings]\nwall_follow.speed_mps = 2.5\nsafety = { backs_out = false }\n"
        "[vehicle]\ngrip_mu = 0.6\n[lidar]\nnoise_std_m = 0.03\n"
        "[[wall]]\npoints = [[9, -1], [9, 0]]\n"
        "[[obstacle]]\nkind = 'box'\nat = [3, 0.2, 0.5]\nsize_m = [0.2, 0.8]\n"
        "[[obstacle]]\nkind = 'box'\nahead_m = 0.9\nleft_m = 0.1\nafter_s = 2\ncar_speed_mps = 1.5\n"
        "[[obstacle]]\nkind = 'person'\nat = [4, -2]\nmoves_mps = [0, 1]\nafter_s = 1\nuntil_s = 3\n"
        "[[fault]]\nkind = 'lidar lost'\nafter_s = 4\n[[expect]]\ncontact = false\n"
    )
    assert scenario.settings.wall_follow.speed_mps == 2.5
    assert not scenario.settings.safety.backs_out
    assert (scenario.conditions.vehicle.grip_mu, scenario.conditions.lidar.noise_std_m) == (0.6, 0.03)
    assert scenario.conditions.lidar.own_parts == "posts"
    start = scenario.start
    assert (start.x_m, start.y_m, start.yaw_rad) == pytest.approx((0.0, 0.4, math.radians(10)))
    assert len(scenario.world.outline_m) == 3
    standing, sudden, walker = scenario.obstacles
    assert (standing.shape, standing.appearance) == (Box(0.2, 0.8), StandingObstacle(Pose(3, 0.2, 0.5)))
    assert sudden.appearance == SuddenObstacle(0.9, 0.1, 1.5, 2)
    assert (walker.shape, walker.motion) == (Round(0.2), ConstantMotion(0, 1, 1, 3))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (HEAD + "sped = 3\n", 3, "sped is unknown here; there are description, world"),
        (HEAD + "[[obstacle]]\nkind = 'box'\nahead_m = 1\n\n[[obstacle]]\nkind = 'box'\nahed_m = 1\n", 9, "ahed_m"),
        (HEAD + "[start]\nspeed = 1\n", 4, "speed is unknown here; there are at, distance_m"),
        (HEAD + "[[wall]]\npoints = [[0, 3], [2, 3]]\n[[wall]]\npoints = [[1, 3], [1, 3]]\n", 5, "has no length"),
        (HEAD + "[[wall]]\npoints = [[0, 3]]\n", 4, "points"),
        (HEAD + "[start]\n\nat = [2.0, 0.95, 0.0]\n", 5, "would start in a wall of corridor"),
        (HEAD + "[start]\ndistance_m = 0.1\n", 4, "would start in a wall of corridor"),
        (HEAD + "[start]\nat = [200, 0, 0]\n", 4, "no wall is within 10 m"),
        (HEAD + "[[obstacle]]\nkind = 'box'\nahead_m = 1.0\nafter_s = 9\n", 6, "the drive ends at 5 s"),
        (HEAD + "[[obstacle]]\nkind = 'box'\nafter_s = 1\n", 3, "say where it is"),
        (HEAD + "[[obstacle]]\nkind = 'pole'\nat = [1, 1]\nsize_m = [1, 1]\n", 3, "a pole has radius_m"),
        (HEAD + "[[obstacle]]\nkind = 'tree'\nat = [1, 1]\n", 4, "tree"),
        (HEAD + "[[fault]]\nkind = 'lidar lost'\nafter_s = 2\nuntil_s = 1\n", 3, "until_s must be later"),
        (HEAD + "[[expect]]\nafter_s = 2\n", 3, "give one of contact, stands"),
        (HEAD + "[[expect]]\ncontact = false\nstands = true\n", 3, "not contact and stands"),
        (HEAD + "[settings]\n\nwall_follow.sped_mps = 2\n", 5, "wall_follow.sped_mps is not a setting; did you mean"),
        (HEAD + "[settings.wall_follow]\nspeed_mps = -2\n", 4, "wall_follow.speed_mps = -2"),
        (HEAD + "[vehicle]\ngrip = 1\n", 4, "vehicle.grip is unknown here; there are wheelbase_m"),
        (HEAD + "[lidar]\nnoise_std_m = 3\n", 4, "lidar.noise_std_m = 3"),
        ("own_parts = 'horns'\n" + HEAD, 1, "write one of none, posts"),
        ("own_parts = 'posts'\n" + HEAD + "[lidar]\nown_parts = 'cables'\n", 5, "own_parts is given twice"),
        (HEAD + "[wall]\npoints = [[0, 3], [2, 3]]\n", 3, "write [[wall]], for there can be several"),
        (HEAD + "[start]\nat = [1, 2]\n", 4, "start.at has too few numbers"),
        (HEAD + "[[fault]]\nkind = 'noisy lidar'\nafter_s = 1\ngrip_mu = 1\n", 3, "grip_mu is nothing of"),
        (HEAD + "[[obstacle]]\nkind = 'box'\nat = [0.3, 0]\n", 3, "it touches the car at the start"),
        (HEAD + "[[obstacle]]\nkind = 'box'\nat = [3, 0]\nleft_m = 1\n", 3, "left_m and car_speed_mps go with ahead_m"),
        (HEAD + "[[obstacle]]\nkind = 'pole'\nat = [3, 0, 1]\n", 3, "a pole is round"),
        (
            HEAD + "[[obstacle]]\nkind = 'box'\nat = [3, 0]\nmoves_mps = [1, 0]\nafter_s = 3\nuntil_s = 2\n", 3,
            "until_s must be later than after_s",
        ),
        (HEAD + "[[obstacle]]\nkind = 'person'\nat = [3, 0]\nmoves_mps = 1.0\n", 6, "moves_mps: write a list in [ ]"),
        (HEAD + "[[expect]]\nlaps_at_least = 1\n", 4, "laps_at_least: corridor has no lap"),
        (HEAD + "[[expect]]\ncontact = false\nuntil_s = 9\n", 5, "until_s: that is 9 s, and the drive ends at 5 s"),
        (HEAD + "[[expect]]\nstands_within_s = 3\nafter_s = 4\n", 4, "that is 7 s, and the drive ends at 5 s"),
        (HEAD + "[settings]\nwall_follow.speed_mps = 2020-01-01\n", 4, "wall_follow.speed_mps is a date or a time"),
        ("duration_s = 0\n", 1, "duration_s = 0"),
        ("\nworld = 'coridor'\n", 2, "no world is called 'coridor'"),
        ("\nworld = 'track:sed=7'\n", 2, "write track:seed=7"),
        ("\nworld = 'gone.yaml'\n", 2, "no map file"),
        ("world = 'empty'\n", 1, "needs [[wall]] and [start] at"),
        ("world = 'corridor'\nworld = 'loop'\n", 2, "is not valid TOML"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_file_and_line(scenario_of, tmp_path, text, line, words):
    with pytest.raises(FileMistakeError) as caught:
        scenario_of(text)
    assert str(caught.value).startswith(f"{tmp_path / 'some.toml'}:{line}: ")
    assert words in str(caught.value)


def test_a_map_without_its_image_is_told(scenario_of, tmp_path):
    (tmp_path / "hall.yaml").write_text("image: gone.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    with pytest.raises(FileMistakeError, match=r"some.toml:2: the map's image .*gone.png is missing"):
        scenario_of("seed = 1\nworld = 'hall.yaml'\n")


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(FileMistakeError, match=r"gone.toml: cannot be read"):
        load_scenario(tmp_path / "gone.toml")


def test_lines_are_found_through_comments_texts_and_lists_of_several_lines(tmp_path):
    file = tmp_path / "lines.toml"
    file.write_text(
        'a = 1 # [b]\ntext = """\n[no]\nc = 2\n"""\nlist = [\n  [1, 2], # ]\n  [3, 4],\n]\n[t."x y"]\nd.e = 3\n'
        "[[many]]\nf = 1\n[[many]]\nf = { g = [\n1] }\n[many.below]\nh = 1\n"
    )
    lines = read_toml(file).lines
    assert lines == {
        ("a",): 1, ("text",): 2, ("list",): 6, ("t", "x y"): 10, ("t", "x y", "d"): 11, ("t", "x y", "d", "e"): 11,
        ("many", 0): 12, ("many", 0, "f"): 13, ("many", 1): 14, ("many", 1, "f"): 15, ("many", 1, "below"): 17,
        ("many", 1, "below", "h"): 18,
    }  # fmt: skip
