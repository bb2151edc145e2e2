"""Sudden boxes before the car's own follower in real time. Run: python benchmarks/sudden_boxes.py [--speeds 2,3,4].

The unmodified `wallride run` over emulated bytes (SCIP over TCP, VESC over a pseudo-terminal); 6 s a run. Beside each
impact stands what a straight full brake would leave: its reaction is the simulated motor's delay and 20 ms. A busy
computer is late, also with its own scans: check the late scans before the impact.
"""

import argparse
import asyncio
import itertools
import time
from collections.abc import Sequence

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.lab.courses.sudden import BOXES, PLACES
from wallride.sim.lab.safety import impact_mps, stopping_m
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.session import RuntimeStart, SimulatorSession
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.virtual.closed_loop import FULL_BRAKE_MPS2, ROUGH_BEAMS
from wallride.sim.world.obstacles import LIDAR_AHEAD_M, sudden_box
from wallride.sim.world.pose import CAR
from wallride.sim.world.worlds import load_world

APPEARS_S, LASTS_S = 4.0, 6.0
ANSWER_S = 0.02
LATE_S = 0.04


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line per run; 1 when a box was hit harder than by a straight full brake and 0.15 m/s more."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--speeds", default="3", help="m/s, with commas (default: 3)")
    parser.add_argument("--distances", default="0.9,0.6", help="from the lidar in m (default: 0.9,0.6)")
    parser.add_argument("--boxes", default="0.8-centred", help=f"of {', '.join(BOXES)}")
    parser.add_argument("--place", default="corridor", choices=PLACES)
    parser.add_argument("--mu", type=float, default=0.8)
    options = parser.parse_args(arguments)
    harder = False
    for box in options.boxes.split(","):
        for speed in options.speeds.split(","):
            for ahead in options.distances.split(","):
                harder |= run(options.place, box, float(speed), float(ahead), options.mu)
    return int(harder)


def run(place: str, box: str, speed_mps: float, ahead_m: float, mu: float) -> bool:
    """Drive once and print the result; return whether the impact was too hard."""
    width_m, left_m = BOXES[box]
    world = load_world(PLACES[place], side="left")
    vehicle = Vehicle(VehicleSettings(grip_mu=mu), world.start)
    thing = sudden_box(ahead_m, width_m=width_m, left_m=left_m, from_s=APPEARS_S)
    scene = WorldScene(world, "left", ROUGH_BEAMS, None, 1, [thing])
    wanted = [f"wall_follow.speed_mps={speed_mps}", "telemetry.any_port=true", "recording.enabled=false"]
    config = find_config()
    session = SimulatorSession(scene, vehicle, load_settings(config, wanted).motor)
    record = asyncio.run(session.run(RuntimeStart(config, wanted), LASTS_S, StopRequest(), lambda _: None))
    before_mps = max(sample.speed_mps for sample in record.track.samples if sample.time_s < APPEARS_S)
    gaps_s = [later.time_s - sooner.time_s for sooner, later in itertools.pairwise(record.track.samples)]
    brake_mps2, gap_m = min(FULL_BRAKE_MPS2, mu * GRAVITY_MPS2), ahead_m + LIDAR_AHEAD_M - CAR.front_m
    reaction_s = ANSWER_S + vehicle.settings.drive_delay_s
    stops = gap_m > stopping_m(before_mps, reaction_s, brake_mps2)
    expected_mps = impact_mps(before_mps, gap_m, reaction_s, brake_mps2)
    hit_mps = vehicle.speed_mps if scene.collided else 0.0
    print(
        f"{place} {box} {ahead_m:g} m, {before_mps:.2f} m/s, mu {mu:g}: "
        f"{f'hit at {hit_mps:.2f} m/s' if scene.collided else 'clear'},"
        f" a straight full brake {'stops' if stops else f'hits at {expected_mps:.2f} m/s'};"
        f" {sum(gap_s > LATE_S for gap_s in gaps_s)} late scans of {len(gaps_s)}"
    )
    return hit_mps > expected_mps + 0.15


if __name__ == "__main__":
    began_s = time.monotonic()
    code = main()
    print(f"{time.monotonic() - began_s:.0f} s")
    raise SystemExit(code)
