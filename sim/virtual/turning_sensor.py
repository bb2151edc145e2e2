"""A lidar of a full circle in virtual time: its emulated head and bytes, its driver's decoder, turns and grid."""

from collections.abc import Callable

import numpy as np

from wallride.drivers.api import Health, MotorState, Scan
from wallride.drivers.rplidar import capsules
from wallride.drivers.rplidar.codec import PlainDecoder
from wallride.drivers.turning.grid import Mount
from wallride.drivers.turning.samples import SampleDecoder
from wallride.drivers.turning.stream import StreamFacts, Turning, TurnStream
from wallride.drivers.ydlidar.codec import PacketDecoder
from wallride.drivers.ydlidar.models import MODELS
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.lidars import TurnMotion
from wallride.sim.devices.lidar_kinds import emulated
from wallride.sim.devices.rplidar import PLAIN, RplidarDevice
from wallride.sim.devices.turning import Rays, TurningDevice, TurningHead
from wallride.sim.devices.ydlidar import YdlidarDevice
from wallride.sim.world.beams import LidarSettings, Millimetres, sector
from wallride.sim.world.place import Surroundings
from wallride.sim.world.pose import Pose

RANGE_MIN_M = 0.15
_SCAN_COMMANDS = {PLAIN: b"\xa5\x20"}


class TurningSensor:
    """Measures a world as a lidar of a full circle does. word: see `sim/devices/lidar_kinds.py`.

    head: the emulated one, with faults to set. health: counts of the driver's stream.
    """

    def __init__(
        self, word: str, lidar: LidarSettings, car: CarSettings, motor: Callable[[], MotorState | None],
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        device = emulated(word)
        if device is None:
            raise ValueError(f"{word!r} is no lidar of a full circle")
        self.health = Health()
        self._lidar = lidar
        self._rng = rng
        self._scans: list[Scan] = []
        self._numbers = 0
        decoder, range_max_m = _started(device, self.health)
        self.head = TurningHead(device)
        facts = StreamFacts(decoder, device.sample_s, RANGE_MIN_M, min(range_max_m, lidar.range_max_m), word)
        turning = Turning(Mount(), 0.1, 0.0, TurnMotion(car, motor))
        self._stream = TurnStream(facts, turning, self.health, self._number, self._scans.append)

    def measure(self, now_s: float, surroundings: Surroundings, pose: Pose) -> list[Scan]:
        """Turn the head to a time and return the scans that were completed meanwhile."""

        def see(rays: Rays) -> Millimetres:
            return sector(surroundings, pose, rays.bearing_rad, rays.start_m, self._rng, self._lidar)

        frames = self.head.turn_to(now_s, see)
        if frames:
            self._stream.on_bytes(b"".join(frames), now_s)
        found, self._scans[:] = list(self._scans), []
        return found

    def _number(self) -> int:
        self._numbers += 1
        return self._numbers - 1


def _started(device: TurningDevice, health: Health) -> tuple[SampleDecoder, float]:
    """Start an emulated device; return the decoder of its stream and its range."""
    if isinstance(device, YdlidarDevice):
        device.feed(b"\xa5\x60")
        model = MODELS[device.model.name.lower()]
        return PacketDecoder(model, health.count), model.range_m[1]
    if not isinstance(device, RplidarDevice):
        raise TypeError(f"no decoder for {type(device).__name__}")
    device.motor_on = True
    device.feed(_SCAN_COMMANDS.get(device.model.stream, _express(device.model.mode)))
    decoder = capsules.decoder_for(device.model.stream, health.count)
    return (PlainDecoder(health.count) if decoder is None else decoder), device.model.range_max_m


def _express(mode: int) -> bytes:
    body = bytes([0xA5, 0x82, 5, mode, 0, 0, 0, 0])
    return body + bytes([int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))])
