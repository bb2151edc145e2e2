"""A motor controller of the user before the simulated wheels."""

from wallride.new.motor_driver import line
from wallride.new.motor_emulator import TIMEOUT_S, MotorDevice
from wallride.sim.devices.own import OwnMotorEmulator


def test_its_command_timeout_acts_while_nothing_comes():
    now_s, device = [10.0], MotorDevice()
    own = OwnMotorEmulator(device, lambda _at_s, _demand: None, clock=lambda: now_s[0])
    device.feed(line("D", 0.1, 1.0), now_s[0])
    kinds = []
    for after_s in (0.9 * TIMEOUT_S, 1.1 * TIMEOUT_S):
        now_s[0] = 10.0 + after_s
        own.report(erpm=4614.0, tachometer=0)
        kinds.append(own.demand(now_s[0]).kind)
    assert kinds == ["speed", "brake"]
