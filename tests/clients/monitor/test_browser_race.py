"""The page of a car that races: the map under the scan, the line, laps, and where the best lap was by now."""

import math

import numpy as np
import pytest

from tests.clients.monitor.axe import violations
from tests.clients.monitor.operating import watching
from wallride.runtime.ros import messages
from wallride.runtime.wire import topics

STAMP_NS = 1_790_000_000_000_000_000
CELL_M = 0.1
X_M, Y_M, YAW_RAD = 5.0, 3.0, math.pi / 2
"""The car looks along y: what is at larger y lies ahead of it, what is at smaller x on its left."""
RACE = {
    "laps": 2, "time_s": 7.25, "best_s": 7.0, "rms_m": 0.021, "p99_m": 0.06, "largest_m": 0.1, "began_s": 100.0,
    "speed_share": 0.8,
}  # fmt: skip
POSE = {
    "map": "lab", "whereabouts": "located", "stamp_s": 101.0, "x_m": X_M, "y_m": Y_M, "yaw_rad": YAW_RAD, "std_m": 0.02,
    "fits": 0.9, "alike": [], "race": RACE,
}  # fmt: skip
RACE_WORDS = "document.querySelector('#line-race dd').textContent"
SHOWN = "['map', 'race', 'ghost'].map((name) => document.querySelector(`.legend .${name}`).checkVisibility())"
DRAWN = """(() => {
  const { scene } = wallride, canvas = document.querySelector('#scene'), { prototype } = CanvasRenderingContext2D;
  const kept = [prototype.drawImage, prototype.stroke], images = [], ways = [];
  const place = (m, u, v) => {
    const x = m.a * u + m.c * v + m.e, y = m.b * u + m.d * v + m.f;
    return [(originY - y) / scale, (originX - x) / scale];
  };
  prototype.drawImage = function (image) { images.push([this.getTransform(), image]); };
  prototype.stroke = function (way) { if (way) ways.push([this.strokeStyle, this.getTransform()]); };
  scene.draw(performance.now());
  [prototype.drawImage, prototype.stroke] = kept;
  const originX = canvas.width / 2, originY = canvas.height * 0.7, [, m] = ways[0];
  const scale = Math.hypot(m.a, m.b);
  const [[of, image]] = images, { data, width } = image.getContext('2d').getImageData(0, 0, image.width, image.height);
  const walls = [];
  for (let i = 0; i < data.length / 4; i++)
    if (data[4 * i + 3]) walls.push(place(of, (i % width) + 0.5, Math.floor(i / width) + 0.5));
  return { walls, start: place(m, 5, 3), colors: ways.map(([color]) => color) };
})()"""


def racing(car, **pose):
    """Have a car tell a map with a wall 2 m ahead and one 1 m to the left, and a line from where it stands."""
    cells = np.zeros((60, 100), dtype=np.int8)
    cells[50, 50] = cells[30, 40] = 100
    line = [(0.0, 5.0, 3.0, YAW_RAD), (0.5, 5.0, 4.0, YAW_RAD), (0.75, 5.0, 5.0, YAW_RAD)]
    car.pose = {**POSE, **pose}
    car.course = {
        topics.POSE: lambda stamp_ns: messages.pose(stamp_ns, X_M, Y_M, YAW_RAD, 0.02, 0.01),
        topics.MAP: lambda _: messages.occupancy_grid(STAMP_NS, cells, CELL_M, (0.0, 0.0, 0.0)),
        topics.LINE: lambda _: messages.path(STAMP_NS, line),
    }


async def test_a_car_without_a_map_has_none_of_it(tab, car):
    assert await tab.run(SHOWN) == [False, False, False]
    assert not await tab.run("document.querySelector('#line-race').checkVisibility()")


async def test_the_map_lies_where_the_car_sees_its_walls_and_the_line_has_its_speeds(scene, tab):
    async with scene.car() as car, scene.monitor():
        racing(car)
        await watching(tab, scene)
        await tab.until(f"{SHOWN}[1]")
        drawn = await tab.run(DRAWN)
        ahead, left = sorted(drawn["walls"], key=lambda place: -place[0])
        assert ahead == pytest.approx([2.05, -0.05], abs=0.02), "x ahead and y to the left, of the middle of the cell"
        assert left == pytest.approx([0.05, 0.95], abs=0.02)
        assert drawn["start"] == pytest.approx([0.0, 0.0], abs=0.02), "the line begins at the car"
        slow, fast = drawn["colors"]
        assert slow != fast
        assert await tab.run("[...wallride.link.newest.line.speed]") == pytest.approx([2.0, 4.0, 0.0], abs=1e-4)
        assert await tab.run("wallride.link.broken") == 0
        assert tab.errors == []
        car.course.pop(topics.POSE)
        await tab.until(f"!{SHOWN}[0]", within_s=3)


async def test_laps_are_told_and_hidden_where_no_line_is_driven(scene, tab):
    async with scene.car() as car, scene.monitor():
        racing(car)
        await watching(tab, scene)
        await tab.until(
            f"{RACE_WORDS} === 'lap 3, at 80 % of the line\\'s speed; the last one 7.25 s, the best 7.00 s;"
            " 2.1 cm from the line (rms), 6 cm in 99 % of it'"
        )
        racing(car, race={**RACE, "laps": 0, "speed_share": 0.6, "best_s": None, "time_s": None})
        await tab.until(f"{RACE_WORDS} === 'lap 1, at 60 % of the line\\'s speed'")
        unknown = {"whereabouts": "ambiguous", "x_m": None, "y_m": None, "yaw_rad": None, "std_m": None}
        racing(car, **unknown, race={**RACE, "laps": 0, "speed_share": 0.6, "began_s": None, "time_s": None})
        await tab.until(f"{RACE_WORDS} === 'not on the line yet; lap 1 will be at 60 % of the line\\'s speed'")
        car.pose = {key: value for key, value in POSE.items() if key != "race"}
        await tab.until("!document.querySelector('#line-race').checkVisibility()")


ROWS = "[...document.querySelectorAll('#lap-rows tr')].map((row) => row.innerText.split('\\t').join(' '))"
BEST = "[...document.querySelectorAll('#laps .best')].map((cell) => cell.textContent)"


async def test_laps_stand_in_a_table_with_their_sectors_and_the_best_of_each(scene, tab):
    async with scene.car() as car, scene.monitor():
        racing(car, race={**RACE, "laps": 0, "time_s": None, "sectors_s": []})
        await watching(tab, scene)
        await tab.until(f"{RACE_WORDS} === 'lap 1, at 80 % of the line\\'s speed'")
        assert not await tab.run("document.querySelector('#laps').checkVisibility()")
        racing(car, race={**RACE, "laps": 1, "time_s": 7.25, "sectors_s": [2.5, 2.25, 2.5]})
        await tab.until(f"{ROWS}.length === 1")
        racing(car, race={**RACE, "laps": 2, "time_s": 7.0, "sectors_s": [2.25, 2.5, 2.25]})
        await tab.until(f"{ROWS}.length === 2")
        assert await tab.run(ROWS) == ["2 7.00 s 2.25 s 2.50 s 2.25 s", "1 7.25 s 2.50 s 2.25 s 2.50 s"]
        assert await tab.run(BEST) == ["7.00 s", "2.25 s", "2.25 s", "2.25 s"]
        assert await violations(tab) == []
        racing(car, race={**RACE, "laps": 1, "time_s": 8.0})
        await tab.until(f"{ROWS}.join() === '1 8.00 s'")  # it has begun anew, and times no sectors


GHOST = """(() => {
  const { course } = wallride.scene, told = { whereabouts: 'located' };
  const lap = (began, took, laps, time, best) => {
    for (let t = 0.1; t < took; t += 0.1)
      course.takeStatus({ stamp_s: began + t, x_m: 10 * laps + t, y_m: 0, yaw_rad: 0,
        race: { began_s: began, laps, time_s: time, best_s: best } });
  };
  const firsts = [];
  for (const lastly of [[100, 7, 0, null, null], [107, 6, 1, 7, 7], [113, 8, 2, 6, 6], [121, 2, 3, 8, 6]]) {
    lap(...lastly);
    firsts.push(course.best[0]?.x ?? null);
  }
  course.takeStatus({ race: { began_s: null } });
  lap(130, 1, 3, 8, 6);
  return [firsts, course.best.length];
})()"""


async def test_the_ghost_is_the_best_lap_that_was_seen_whole(tab, car):
    car.publishing = False
    await tab.until("document.querySelector('#view').dataset.old === 'true'")
    firsts, length = await tab.run(GHOST)
    assert firsts == pytest.approx([None, 0.1, 10.1, 10.1]), "after the lap of 8 s it is still that of 6 s"
    assert length == pytest.approx(60, abs=1)


CARRIED = """(() => {
  const { course } = wallride.scene;
  wallride.link.seenMs.pose = performance.now();
  course.takePose({ stamp: 1000.0, x: 1, y: 2, yaw: 3.1 });
  course.takePose({ stamp: 1000.05, x: 1.3, y: 2, yaw: -3.1 });
  return course.poseAt(1000.075, performance.now());
})()"""


async def test_the_map_is_drawn_by_the_pose_at_the_time_of_the_scan(tab, car):
    car.publishing = False
    await tab.until("document.querySelector('#view').dataset.old === 'true'")
    pose = await tab.run(CARRIED)
    assert (pose["x"], pose["y"]) == pytest.approx((1.45, 2.0))
    assert pose["yaw"] == pytest.approx(-3.1 + (2 * math.pi - 6.2) / 2)
