"""An asynchronous byte link opened by its address; the transport is hidden from everything above it.

    tcp://192.168.0.10:10940
    serial:///dev/wallride-lidar?baud=115200

Both kinds are one non-blocking file descriptor under `loop.add_reader`: for a scan of 3 kB that is one read and two
thirds of the CPU of a stream protocol, and the time stamp is taken in the very callback that the bytes woke. This is
the only module that imports serial, and it does so only to open and configure a port.
"""

import asyncio
import contextlib
import errno
import fcntl
import os
import socket
import struct
import termios
from collections.abc import Callable, Coroutine
from typing import Any, Never, TypeVar

from wallride.drivers import spare_descriptors
from wallride.drivers.address import Address, SerialAddress, TcpAddress
from wallride.drivers.api import Clock, LinkLost

E = TypeVar("E", bound=Exception)
T = TypeVar("T")

BytesHandler = Callable[[bytes, float], None]
"""Takes a chunk and the monotonic time at which it was read."""
Tap = Callable[[str, bytes, float], None]
"""Takes the traffic of a link, for a recording: "in" or "out", the bytes, the monotonic time."""

CONNECT_TIMEOUT_S = 2.0
_READ_BYTES = 16384
_NO_SUCH_LINE = frozenset({errno.ENOTTY, errno.EINVAL, errno.EOPNOTSUPP})


class ByteLink:
    """One open port. Bytes go to the handler given to `listen`; errors are raised by `lost()`.

    Guarantees: bytes arrive in order and none is dropped here; a write is complete or raises LinkLost; after the first
    LinkLost nothing more is delivered. The handler runs inside the event loop and must not block.

    clock: as given. reading_s: duration of the newest chunk's read from the kernel. tap: called with all traffic, both
        ways.
    """

    def __init__(self, address: Address, fd: int, release: Callable[[bool], None], clock: Clock) -> None:
        self.address = address
        self._fd = fd
        self._release = release
        self.clock = clock
        self._loop = asyncio.get_running_loop()
        self._lost: asyncio.Future[Never] = self._loop.create_future()
        self._handler: BytesHandler | None = None
        self._open = True
        self._over: asyncio.Future[None] | None = None
        self.reading_s = 0.0
        self.tap: Tap | None = None

    def listen(self, handler: BytesHandler) -> None:
        """Pass every chunk from now on to `handler(chunk, read_at_s)`, replacing an earlier handler."""
        if self._handler is None and self._open:
            self._loop.add_reader(self._fd, self._on_readable)
        self._handler = handler

    def write(self, data: bytes) -> None:
        """Write all of it now or raise LinkLost; a device that does not take a command counts as lost."""
        if not self._open:
            raise LinkLost(f"{self.address}: the link is closed")
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            raise self._fail(LinkLost(f"{self.address}: {_explain(error)}")) from error
        if written != len(data):
            raise self._fail(LinkLost(f"{self.address}: it stopped taking bytes (hung device? power-cycle it)"))
        if self.tap is not None:
            self.tap("out", data, self.clock())

    def set_data_terminal_ready(self, on: bool) -> None:  # noqa: FBT001 - the state of a line
        """Set the line DTR of a serial port, which starts and stops the motor of some lidars; other links have none."""
        if not self._open:
            return
        try:
            fcntl.ioctl(self._fd, termios.TIOCMBIS if on else termios.TIOCMBIC, struct.pack("I", termios.TIOCM_DTR))
        except OSError as error:
            if error.errno not in _NO_SUCH_LINE:
                raise self._fail(LinkLost(f"{self.address}: {_explain(error)}")) from error

    async def lost(self) -> Never:
        """Wait until the link is lost and raise the reason; a bug in the handler is raised here too, unchanged."""
        await asyncio.shield(self._lost)
        raise AssertionError("unreachable: the future only ever fails")

    async def repeat(self, job: Callable[[], float]) -> Never:
        """Call `job`, and again after each pause [s] that it returns; raise its error, or the reason of a lost link.

        Uses the loop's timer itself, because a task that sleeps costs one more turn of the loop. One caller at a time.
        """
        over = self._over = self._loop.create_future()
        timer: asyncio.TimerHandle | None = None

        def call() -> None:
            nonlocal timer
            try:
                timer = self._loop.call_later(job(), call)
            except Exception as error:  # noqa: BLE001 - not swallowed: it is raised below
                if not over.done():  # else the link was lost in the middle, and raises that itself
                    over.set_exception(error)

        try:
            if not self._lost.done():
                call()
                await over
            self._lost.result()
        finally:
            self._over = None
            if timer is not None:
                timer.cancel()
        raise AssertionError("unreachable: only an error or a loss ends it")

    def close(self) -> None:
        """Release the port; harmless when repeated."""
        if not self._open:
            return
        self._open = False
        self._loop.remove_reader(self._fd)
        # Reading the exception also marks it as retrieved for asyncio.
        failure = self._lost.exception() if self._lost.done() and not self._lost.cancelled() else None
        # After a bug in this program the device is still there, and the brake that was just written must reach it.
        self._release(isinstance(failure, LinkLost))
        spare_descriptors.refill()
        self._lost.cancel()

    def _on_readable(self) -> None:
        # An exception that leaves a reader callback is merely logged by asyncio, and the loop would spin on a dead
        # descriptor: whatever happens here has to end in `lost()`.
        stamp_s = self.clock()
        try:
            chunk = os.read(self._fd, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._fail(LinkLost(f"{self.address}: {_explain(error)}"))
            return
        if not chunk:
            self._fail(LinkLost(f"{self.address}: the other side closed it (unplugged, or another client took over)"))
            return
        self.reading_s = self.clock() - stamp_s
        assert self._handler is not None, "the reader is only added by listen()"  # noqa: S101
        try:
            if self.tap is not None:
                self.tap("in", chunk, stamp_s)
            self._handler(chunk, stamp_s)
        except Exception as error:  # noqa: BLE001 - not swallowed: it is raised out of lost()
            self._fail(error)

    def _fail(self, error: E) -> E:
        self._loop.remove_reader(self._fd)
        if not self._lost.done():
            self._lost.set_exception(error)
        if self._over is not None and not self._over.done():
            self._over.set_result(None)
        return error


async def until_lost(link: ByteLink, work: Coroutine[Any, Any, T]) -> T:
    """Do the work, or raise LinkLost as soon as the link is lost; none of it is left running."""
    lost = asyncio.ensure_future(link.lost())
    working = asyncio.ensure_future(work)
    try:
        await asyncio.wait((lost, working), return_when=asyncio.FIRST_COMPLETED)
        if lost.done() and not working.done():
            lost.result()
        return await working
    finally:
        lost.cancel()
        working.cancel()
        await asyncio.gather(lost, working, return_exceptions=True)


async def open_link(address: Address, clock: Clock, *, dtr: bool = True) -> ByteLink:
    """Open the port; LinkLost names the obstacle and the usual remedy. dtr: state of that line of a serial port."""
    if isinstance(address, TcpAddress):
        return await _open_tcp(address, clock)
    return _open_serial(address, clock, dtr=dtr)


async def _open_tcp(address: TcpAddress, clock: Clock) -> ByteLink:
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            family, kind, protocol, _, target = (
                await loop.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)
            )[0]
            with spare_descriptors.freed():
                sock = socket.socket(family, kind, protocol)
            try:
                spare_descriptors.check(sock.fileno())
                sock.setblocking(False)  # noqa: FBT003
                sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                _keep_alive(sock)
                await loop.sock_connect(sock, target)
            except BaseException:
                sock.close()
                raise
    except TimeoutError as error:
        raise LinkLost(f"{address}: no answer within {CONNECT_TIMEOUT_S:g} s (power, cable, or the address)") from error
    except OSError as error:
        raise LinkLost(f"{address}: {_explain(error)}") from error
    return ByteLink(address, sock.fileno(), lambda _: sock.close(), clock)


def _keep_alive(sock: socket.socket) -> None:
    """Detect a pulled cable within seconds even while there is nothing to send."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in (("TCP_KEEPIDLE", 1), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", 3)):
        if hasattr(socket, option):  # macOS names the first one differently
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


def _open_serial(address: SerialAddress, clock: Clock, *, dtr: bool) -> ByteLink:
    import serial  # 20 ms, and a lidar on Ethernet never needs it

    port = serial.Serial(baudrate=address.baud, timeout=0, exclusive=True)
    port.port = address.path
    port.dtr = dtr
    try:
        with spare_descriptors.freed():
            port.open()
        spare_descriptors.check(port.fileno())
        # pyserial's lock is advisory; this one also keeps out ModemManager and other drivers.
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
        port.reset_input_buffer()
    except (OSError, termios.error) as error:  # SerialException is an OSError, with the errno inside
        port.close()
        raise LinkLost(f"{address}: {_explain(error)}") from error
    fd = port.fileno()
    os.set_blocking(fd, False)

    def release(lost: bool) -> None:  # noqa: FBT001 - one caller, three lines up
        # Closing a port with unsent bytes can wait half a minute in the kernel when the device hangs: after a loss
        # they are thrown away. On a clean close they stay, because the last of them is a brake.
        if lost:
            with contextlib.suppress(termios.error):
                termios.tcflush(fd, termios.TCOFLUSH)
        port.close()

    return ByteLink(address, fd, release, clock)


_REMEDIES = {
    errno.ENOENT: "no such device (plug it in; is the udev rule installed?)",
    errno.EACCES: "permission denied (add the user to the group dialout, then log in again)",
    errno.EBUSY: "another program holds it (ModemManager, a second wallride, a serial monitor)",
    errno.EAGAIN: "another program holds it (ModemManager, a second wallride, a serial monitor)",
    errno.EISDIR: "is a directory, not a device",
    errno.ENOTTY: "is not a serial port",
    errno.EIO: "unplugged, or its power failed",
    errno.ENODEV: "unplugged, or its power failed",
    errno.ENXIO: "unplugged, or its power failed",
    errno.ECONNREFUSED: "connection refused (another client connected? a sensor serves only one; right port?)",
    errno.ECONNRESET: "connection reset (sensor restarted, or another client took over)",
    errno.EHOSTUNREACH: "no route (give this computer an address in the sensor's subnet, not the sensor's own)",
    errno.ENETUNREACH: "network unreachable (is the interface up, with an address in the sensor's subnet?)",
    errno.EPIPE: "the other side closed it",
    errno.EMFILE: "this process has too many connections open (see wallride status; raise LimitNOFILE)",
}


def _explain(error: BaseException) -> str:
    """Return the meaning of an error for the person at the cables; pyserial hides some error numbers one level down."""
    for cause in (error, error.__context__):
        code = getattr(cause, "errno", None) or next(iter(cause.args if cause is not None else ()), None)
        if isinstance(code, int) and code in _REMEDIES:
            return _REMEDIES[code]
    return str(error)
