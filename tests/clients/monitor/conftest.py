"""A monitor with a fake car behind it, and a browser where there is one."""

from contextlib import asynccontextmanager

import pytest

from tests.clients.monitor.fake_car import FakeCar
from tests.clients.monitor.operating import watching
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.ports import free_endpoint

pytest.importorskip("aiohttp", reason="the monitor needs aiohttp: pip install '.[monitor]'")


class Scene:
    """endpoint: of the car. url: of the page. car: the fake one, while it runs."""

    def __init__(self, endpoint):
        self.endpoint = endpoint
        self.url = ""
        self.port = 0

    def car(self, **more):
        return FakeCar(self.endpoint, **more)

    @property
    def base(self):
        """The page's address without its token."""
        return self.url.partition("?")[0]

    @property
    def token(self):
        return self.url.partition("?token=")[2]

    @asynccontextmanager
    async def monitor(self, *, address="127.0.0.1", name="ann@laptop", also=(), **more):
        from wallride.clients.monitor.relay import CarEndpoint, Relay
        from wallride.clients.monitor.server import serving
        from wallride.clients.monitor.session import Host
        from wallride.clients.teleop.shaping import InputShape

        places = [CarEndpoint(one, zenoh_config.client_config(one, None)) for one in (self.endpoint, *also)]
        host = Host(Relay(places), name, InputShape(), "9.9", **more)
        async with serving(host, address, self.port) as self.url:
            self.port = int(self.url.split(":")[2].split("/")[0])
            yield self


@pytest.fixture(autouse=True)
def data(monkeypatch, tmp_path_factory):
    """Keep the page's token, as a login does, and what is made of laps, in folders of the test; return the latter's."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
    monkeypatch.setenv("XDG_DATA_HOME", str(folder := tmp_path_factory.mktemp("data")))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    return folder / "wallride"


@pytest.fixture
def scene():
    return Scene(free_endpoint())


@pytest.fixture
async def car(scene, tab):
    """A car whose page is open."""
    async with scene.car() as car, scene.monitor():
        await watching(tab, scene)
        yield car
