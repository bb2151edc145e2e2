"""How far a car rolls when nothing commands its Maestro any more: what docs/devices.md says."""

from pathlib import Path

from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.esc import EmulatedEsc, EscModel
from wallride.sim.devices.maestro import MaestroEmulator

DEVICES = Path(__file__).resolve().parents[3] / "docs" / "devices.md"
THROTTLE, ARMING_S, DRIVES_S, ROLLS_S = 0, 1.3, 5.0, 8.0


def rolled_m(speed_mps):
    """Return the way from the last command to standstill."""
    now_s, model = [0.0], EscModel()
    board = MaestroEmulator(EmulatedEsc(model), throttle=THROTTLE, clock=lambda: now_s[0])
    vehicle = Vehicle()
    plant = Plant(vehicle, board, VescSettings(), 0.0)

    def command(pulse_us):
        quarters = round(4 * pulse_us)
        board._answers(bytes((0x84, THROTTLE, quarters & 0x7F, quarters >> 7)))

    while now_s[0] < DRIVES_S:
        now_s[0] += 0.025
        driven_us = model.neutral_us + model.dead_us + model.us_per_mps * speed_mps
        command(driven_us if now_s[0] > ARMING_S else model.neutral_us)
        plant.advance(now_s[0])
    assert abs(vehicle.speed_mps - speed_mps) < 0.01
    from_m = vehicle.x_m
    now_s[0] += ROLLS_S
    plant.advance(now_s[0])
    assert vehicle.speed_mps < 0.01
    return vehicle.x_m - from_m


def test_the_ways_are_those_of_the_page():
    ways = ", ".join(f"{rolled_m(one):.1f} m from {one:g} m/s" for one in (1.0, 1.5))
    last = f" and {rolled_m(2.0):.1f} m from 2 m/s"
    assert ways + last in " ".join(DEVICES.read_text(encoding="utf-8").split())
