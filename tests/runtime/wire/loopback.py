"""Sessions of a car and its clients on loopback, for the tests of the bus."""

from tests.waiting import until
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint

KEY = "wallride/car1/operator/command"


def car_config(endpoint, *, limits=True):
    """Return a car's configuration; without limits a client may send as fast as it likes."""
    config = zenoh_config.car_config([endpoint], None, (), "car1")
    return config if limits else {key: config[key] for key in config.keys() - {"downsampling", "low_pass_filter"}}


def client_of(endpoint):
    return Bus(zenoh_config.client_config(endpoint, None))


def both(*, limits=True):
    """Return a car and its client, neither of them open."""
    endpoint = free_endpoint()
    return Bus(car_config(endpoint, limits=limits)), client_of(endpoint)


async def connected(publisher, key=KEY):
    await until(lambda: publisher.wanted(key))
