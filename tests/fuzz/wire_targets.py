"""What comes over a wire: SCIP, VESC, commands, requests, a page's messages. Each target takes any bytes."""

import asyncio
import random
import struct
from binascii import crc_hqx

from tests.runtime.operator_rig import Rig
from wallride.clients.monitor import messages
from wallride.drivers.api import ProtocolError
from wallride.drivers.hokuyo.codec import ScipDeframer, checksum
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.drivers.hokuyo.replies import SensorParameters, fields
from wallride.drivers.vesc import codec, replies
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire.teleop import Beat, CarCondition, Command, Input, Malformed, Press, read_beat, read_command
from wallride.sim.devices.vesc_replies import firmware_reply, imu_reply, values_reply

SCAN_BEAMS = 27
PRINT = 21  # a line of text, which a VESC sends at any time


def scip_seeds():
    """Return blocks of every kind."""
    digits = bytes(0x30 + i % 64 for i in range(3 * SCAN_BEAMS))
    rows = [digits[at : at + 64] for at in range(0, len(digits), 64)]
    scan = [b"MD0000002601000", b"99", b"0`0A", *rows]
    many = [b"HD0000002601", b"00", b"0000", b"0A0&0A10B0"]
    about = [b"PP", b"00", b"MODL:UST-10LX;", b"DMIN:20;", b"DMAX:30000;", b"ARES:1440;", b"AMIN:0;", b"AMAX:1080;",
             b"AFRT:540;", b"SCAN:2400;"]  # fmt: skip
    return [b"\n".join(scan), b"\n".join(many), b"\n".join(about), b"II\n00\nSTAT:ok;"]


def scip(dice, data):
    """Feed a deframer in pieces, and read what it finds; the sums of three inputs in four are made right."""
    if dice.random() < 0.75:
        head, *lines = data.split(b"\n")
        data = b"\n".join([head, *(line + bytes([checksum(line)]) for line in lines)])
    deframer = ScipDeframer()
    decoder = RangeDecoder(SCAN_BEAMS, 20, 30000)
    cut = dice.randrange(len(data) + 1)
    for block in [*deframer.feed(data[:cut]), *deframer.feed(data[cut:] + b"\n\n")]:
        if len(block.lines) == 2:
            decoder.decode(block.lines[1])
        said = fields(block)
        assert all(text.isprintable() for text in said.values())
        try:
            found = SensorParameters.from_fields(said)
        except ProtocolError:
            continue
        assert isinstance(found.unfit, str)
    deframer.feed(b"\n\n")
    assert len(deframer.feed(b"QT\n00P\n\n")) == 1, "the next reply is whole again"


def vesc_seeds():
    """Return payloads of every reply."""
    values = {"erpm": 1000.0, "voltage_v": 12.0, "tachometer": 5}
    return [
        firmware_reply((6, 5), kind=0), values_reply((6, 5), values), values_reply((2, 18), values),
        imu_reply((6, 5), codec.get_imu(), (0.5,) * 16, 74), bytes([PRINT]) + b"hello",
    ]  # fmt: skip


def vesc(dice, payload):
    """Feed a deframer with the payload in a frame, or with the bare bytes; read every payload in every way."""
    data = payload
    if payload and dice.random() < 0.75:
        size = min(len(payload), 512)
        head = bytes([2, size]) if size < 256 else bytes([3, size >> 8, size & 0xFF])
        data = head + payload[:size] + struct.pack(">H", crc_hqx(payload[:size], 0)) + b"\x03"
    deframer = codec.VescDeframer()
    cut = dice.randrange(len(data) + 1)
    for found in [*deframer.feed(data[:cut]), *deframer.feed(data[cut:]), *deframer.give_up()]:
        for read in (
            replies.decode_firmware, replies.decode_values, replies.decode_values_2x, replies.decode_imu,
        ):  # fmt: skip
            read(found)
    hello = bytes([PRINT]) + b"hello"
    assert deframer.feed(codec.frame(hello)) == [hello], "nothing of what was given up is kept"


def teleop_seeds():
    """Return commands and a heartbeat."""
    command = Command(5, 1, 0xCAFE, 1, Press.MANUAL, Input.PAD, 0, 1.0, 0.1, "Ann")
    return [
        command.pack(),
        Command(6, 1, 0, 0, Press.ESTOP, Input.PAGE).pack(),
        Beat(1, 2, CarCondition(3), speed_mps=1.0).pack(),
    ]


class Teleop:
    """An operator's desk, which takes anything, and both readers."""

    def __init__(self):
        self.rig = Rig()
        self.taken = 0

    def __call__(self, _dice, data):
        """Read it, and hand it to the desk."""
        for read in (read_command, read_beat):
            try:
                read(data)
            except Malformed:
                pass
        self.taken += 1
        self.rig.now_s += 0.001
        if self.taken % 20 == 0:
            self.rig.beat()
        self.rig.desk.receive("", data, self.rig.now_s)


def parameter_seeds():
    """Return requests of every kind."""
    return [
        b'{"under": "safety."}', b'{"names": ["wall_follow.kp", "car.name"], "by": "ann"}', b'{"most": 5}', b"{}",
        b'{"values": {"wall_follow.kp": 0.5, "safety.binds_teleop": true, "wall_follow.side": "left"}}',
        b'{"values": {"mux.order": ["e-stop", "teleop"], "wall_follow.method": "report"}, "by": "x"}',
    ]  # fmt: skip


class Parameters:
    """A parameter server without a file."""

    def __init__(self):
        self.now_s = 0.0
        context = ServerContext(lambda *_: None, lambda: True, self.clock, lambda: "a day")
        self.server = ParameterServer(Settings(), context, ChangeHistory(100))

    def clock(self):
        """Go on by a second."""
        self.now_s += 1.0
        return self.now_s

    def __call__(self, dice, data):
        """Ask one of the six questions."""
        server = self.server
        ask = dice.choice(
            (server.list_all, server.get_some, server.set_some, server.save, server.configure, server.past)
        )
        try:
            answer = ask(data)
            if asyncio.iscoroutine(answer):
                answer.send(None)  # without a file nothing is awaited
        except (UnacceptableError, StopIteration) as error:
            assert len(str(error)) < 60_000
            assert str(error).isascii()


def page_seeds():
    """Return messages of a page."""
    return [
        b'{"t":"ack","n":5}', b'{"t":"watch","car":"car1"}', b'{"t":"stop"}', b'{"t":"ping","at":1.5}', b'{"t":"drop"}',
        b'{"t":"ask","id":1,"what":"param/set","question":{"values":{"wall_follow.kp":1}}}',
    ]  # fmt: skip


def page(_dice, data):
    """Read a page's message."""
    try:
        messages.read(data.decode(errors="replace"))
    except messages.BadMessageError as error:
        assert len(str(error)) < 1000


def seeds_of_wires() -> "dict[str, tuple[object, list[bytes], int]]":
    """Return (target, seeds, most bytes) by name."""
    random.seed(0)
    return {
        "scip": (scip, scip_seeds(), 9000),
        "vesc": (vesc, vesc_seeds(), 2000),
        "teleop": (Teleop(), teleop_seeds(), 2000),
        "parameters": (Parameters(), parameter_seeds(), 5000),
        "page": (page, page_seeds(), 20000),
    }
