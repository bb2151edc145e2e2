"""Asks at each place in every protocol that wallride knows, until one is answered.

Only a reply that its codec accepts counts. Of a YDLIDAR that never answers, three packets with right checksums do.
"""

import asyncio
import time
from collections.abc import Sequence
from typing import Any, Final, Literal

from pydantic import ValidationError

from wallride.drivers.address import TcpAddress, parse_address
from wallride.drivers.api import Clock, DriverError, LinkLost, ProtocolError
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.link import open_link
from wallride.drivers.rplidar.driver import Rplidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.conversation import describe
from wallride.drivers.value import value
from wallride.drivers.ydlidar.driver import Ydlidar
from wallride.drivers.ydlidar.settings import YdlidarSettings

KnownSettings = HokuyoSettings | RplidarSettings | YdlidarSettings
ONE_WAY: Final[tuple[Literal["x2", "x4-pro"], ...]] = ("x2", "x4-pro")
"""YDLIDAR models that never answer; listened for last, because the packets of others are like theirs."""
_HEARD_BYTES: Final = 4096


@value()
class FoundLidar:
    """The one lidar found. settings: of its driver. identity: as it told it. place: where it answered."""

    settings: KnownSettings
    identity: str
    place: str


@value()
class _Look:
    """What one place showed. found: a lidar. trouble: of a lidar that answers and cannot be used. else: why none."""

    found: FoundLidar | None = None
    trouble: str = ""
    none: str = ""


async def find_lidar(settings: AutoLidarSettings, at: Sequence[str], *, clock: Clock = time.monotonic) -> FoundLidar:
    """Return the one lidar at these addresses, all looked at together; it is left quiet, its port closed.

    DriverError where there is none, or more than one: it is never chosen among several.
    """
    looks = await asyncio.gather(*(_look(address, settings, clock) for address in at))
    lidars = [
        *(f"{look.found.identity} at {look.found.place}" for look in looks if look.found is not None),
        *(look.trouble for look in looks if look.trouble),
    ]
    if len(lidars) > 1:
        raise DriverError(f"two lidars answer: {'; '.join(lidars)} (name the address of one in lidar.address)")
    if lidars and (found := next((look.found for look in looks if look.found is not None), None)) is not None:
        return found
    if lidars:
        raise ProtocolError(lidars[0])
    why = "; ".join(look.none for look in looks)
    raise LinkLost(f"no lidar found: {why} (plug it in and power it, or name it in lidar.driver)")


async def _look(address: str, settings: AutoLidarSettings, clock: Clock) -> _Look:
    """Ask at one address in one protocol after the other."""
    heard = bytearray()

    def hear(way: str, data: bytes, _at_s: float) -> None:
        if way == "in" and len(heard) < _HEARD_BYTES:
            heard.extend(data)

    try:
        (await open_link(parse_address(address), clock, dtr=False)).close()
        for kind in _kinds(address):
            driver = _driver(kind, clock)
            driver.tap = hear
            try:
                where, identity = await driver.identify()
            except LinkLost:
                continue
            return _Look(_found(kind, settings, identity, str(where)))
    except ProtocolError as error:
        return _Look(trouble=str(error))
    except LinkLost as error:
        return _Look(none=str(error))
    return _Look(none=f"{address}: {describe(bytes(heard))}")


def _kinds(address: str) -> list[KnownSettings]:
    """Return the lidars to try, the likeliest first: a Hokuyo on a network, and others on a serial line."""
    hokuyo: list[KnownSettings] = [HokuyoSettings(address=address)]
    turning: list[KnownSettings] = [RplidarSettings(address=address), YdlidarSettings(address=address)]
    silent = [YdlidarSettings(address=address, model=model) for model in ONE_WAY]
    if isinstance(parse_address(address), TcpAddress):
        return [*hokuyo, *turning, *silent]
    return [*turning, *hokuyo, *silent]


def _driver(kind: KnownSettings, clock: Clock) -> Hokuyo | Rplidar | Ydlidar:
    if isinstance(kind, HokuyoSettings):
        return Hokuyo(kind, clock=clock)
    return Rplidar(kind, clock=clock) if isinstance(kind, RplidarSettings) else Ydlidar(kind, clock=clock)


def _found(kind: KnownSettings, settings: AutoLidarSettings, identity: str, place: str) -> FoundLidar:
    """Return the lidar with its settings; ProtocolError where it cannot have them."""
    said: dict[str, Any] = settings.model_dump(include=settings.model_fields_set - {"driver", "address"})
    try:
        chosen = type(kind).model_validate({**kind.model_dump(exclude_unset=True), **said, "address": place})
    except ValidationError as error:
        one = error.errors()[0]
        key = ".".join(map(str, one["loc"]))
        raise ProtocolError(f"{identity} at {place}: lidar.{key} = {one['input']!r}: {one['msg']}") from None
    return FoundLidar(chosen, identity, place)
