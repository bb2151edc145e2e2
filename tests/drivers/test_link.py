"""The byte link: addresses, and what becomes of every kind of trouble with a port."""

import asyncio
import os
import socket
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from wallride.drivers.address import SerialAddress, TcpAddress, parse_address
from wallride.drivers.api import LinkLost
from wallride.drivers.link import open_link

PATIENCE_S = 5.0


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("tcp://192.168.0.10:10940", TcpAddress("192.168.0.10", 10940)),
        ("tcp://lidar.local:1", TcpAddress("lidar.local", 1)),
        ("tcp://[fe80::1]:65535/", TcpAddress("fe80::1", 65535)),
        ("serial:///dev/ttyACM0", SerialAddress("/dev/ttyACM0", 115200)),
        ("serial:///dev/wallride-lidar?baud=128000", SerialAddress("/dev/wallride-lidar", 128000)),
    ],
)
def test_good_addresses(text, address):
    assert parse_address(text) == address
    assert parse_address(str(address).replace("tcp://fe80::1:", "tcp://[fe80::1]:")) == address


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is not an address"),
        ("/dev/ttyACM0", "is not an address"),
        ("http://192.168.0.10:10940", "is not an address"),
        ("tcp://192.168.0.10", "needs a host and a port"),
        ("tcp://:10940", "needs a host and a port"),
        ("tcp://host:0", "needs a host and a port"),
        ("tcp://host:65536", "no port between"),
        ("tcp://host:abc", "no port between"),
        ("tcp://host:10940/scan", "something after the port"),
        ("tcp://host:10940?baud=1", "something after the port"),
        ("serial://dev/ttyACM0", "three slashes"),
        ("serial:///", "three slashes"),
        ("serial:dev", "three slashes"),
        ("serial:///dev/x?baud=fast", "not a positive number"),
        ("serial:///dev/x?baud=0", "not a positive number"),
        ("serial:///dev/x?baud=", "not a positive number"),
        ("serial:///dev/x?baud=-5", "not a positive number"),
        ("serial:///dev/x?parity=even", "unknown option 'parity'"),
    ],
)
def test_bad_addresses_say_what_is_wrong_and_how_to_write_it(text, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        parse_address(text)
    assert repr(text) in str(caught.value)
    assert "serial:///dev/NAME" in str(caught.value)


@dataclass
class Terminal:
    """A pseudo-terminal whose near end a test holds."""

    master: int
    slave: int
    plugged: bool = True

    @property
    def address(self) -> SerialAddress:
        return SerialAddress(os.ttyname(self.slave))

    def unplug(self) -> None:
        if self.plugged:
            os.close(self.slave)
            os.close(self.master)
        self.plugged = False


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    master, slave = os.openpty()
    tty.setraw(slave)
    terminal = Terminal(master, slave)
    yield terminal
    terminal.unplug()


def clock() -> float:
    return 12.5


async def reason(link) -> Exception:
    """Wait until the link is lost and return why."""
    with pytest.raises(Exception) as caught:  # noqa: PT011 - the caller looks at it
        async with asyncio.timeout(PATIENCE_S):
            await link.lost()
    return caught.value


async def test_a_missing_device_names_the_port_and_the_udev_rule():
    with pytest.raises(LinkLost, match=r"/dev/wallride-not-there.*no such device.*udev"):
        await open_link(SerialAddress("/dev/wallride-not-there"), clock)


async def test_a_file_is_not_a_serial_port(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(LinkLost, match=r"/file\?.*(is not a serial port|Inappropriate ioctl)"):
        await open_link(SerialAddress(str(tmp_path / "file")), clock)


async def test_a_second_user_of_a_port_is_told_that_it_is_held(terminal):
    link = await open_link(terminal.address, clock)
    with pytest.raises(LinkLost, match="another program holds it"):
        await open_link(terminal.address, clock)
    link.close()


async def test_a_refused_connection_says_so():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    with pytest.raises(LinkLost, match="connection refused"):
        await open_link(TcpAddress("127.0.0.1", port), clock)


async def test_bytes_come_with_the_time_of_their_reading_and_go_out_whole(terminal):
    link = await open_link(terminal.address, clock)
    arrived: asyncio.Queue[tuple[bytes, float]] = asyncio.Queue()
    link.listen(lambda chunk, stamp_s: arrived.put_nowait((chunk, stamp_s)))
    os.write(terminal.master, b"\x02\x03\r\n\x00")
    async with asyncio.timeout(PATIENCE_S):
        assert await arrived.get() == (b"\x02\x03\r\n\x00", 12.5)
    link.write(b"\x03\x11\x13\xff")  # XON and XOFF are data
    assert os.read(terminal.master, 100) == b"\x03\x11\x13\xff"
    link.close()


async def test_an_unplugged_port_comes_out_of_lost(terminal):
    link = await open_link(terminal.address, clock)
    link.listen(lambda chunk, stamp_s: None)
    terminal.unplug()
    assert isinstance(await reason(link), LinkLost)
    link.close()


async def test_a_write_to_a_dead_port_raises_and_comes_out_of_lost(terminal):
    link = await open_link(terminal.address, clock)
    terminal.unplug()
    with pytest.raises(LinkLost, match="unplugged"):
        link.write(b"\x02")
    assert "unplugged" in str(await reason(link))
    link.close()


async def test_a_port_that_takes_no_more_bytes_is_lost(terminal):
    link = await open_link(terminal.address, clock)

    def flood() -> None:
        for _ in range(1000):
            link.write(bytes(1000))

    with pytest.raises(LinkLost, match="stopped taking bytes"):
        flood()
    assert isinstance(await reason(link), LinkLost)
    link.close()


async def test_a_bug_in_the_handler_comes_out_of_lost_as_itself(terminal):
    link = await open_link(terminal.address, clock)

    def buggy(chunk: bytes, stamp_s: float) -> None:
        raise KeyError(chunk)

    link.listen(buggy)
    os.write(terminal.master, b"x")
    assert isinstance(await reason(link), KeyError)
    link.close()


async def test_a_server_that_hangs_up_is_lost():
    async def hang_up(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.close()

    server = await asyncio.start_server(hang_up, "127.0.0.1", 0)
    async with server:
        link = await open_link(TcpAddress("127.0.0.1", server.sockets[0].getsockname()[1]), clock)
        link.listen(lambda chunk, stamp_s: None)
        assert "closed it" in str(await reason(link))
        link.close()


async def test_a_closed_link_takes_nothing_and_closes_once_more_without_complaint(terminal):
    link = await open_link(terminal.address, clock)
    link.close()
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.write(b"\x02")
    reopened = await open_link(terminal.address, clock)  # the lock went with it
    reopened.close()
