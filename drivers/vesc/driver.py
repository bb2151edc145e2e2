"""The connection to a VESC: find, identify, poll and command it, and reconnect after every loss.

Contains no format and no conversion: those are in `codec`, `replies` and `calibration`.
"""

import asyncio
import contextlib
import time
from collections.abc import Callable
from functools import partial
from typing import Never

from wallride.drivers.address import parse_address
from wallride.drivers.api import (
    Clock,
    Drive,
    Health,
    LinkLost,
    LinkState,
    MotorState,
    ProtocolError,
    Reschedule,
    as_wanted,
)
from wallride.drivers.link import ByteLink, Tap, open_link
from wallride.drivers.vesc import codec, replies
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.condition import VescMonitor
from wallride.drivers.vesc.inertia import Inertia
from wallride.drivers.vesc.settings import VescSettings

IDENTIFY_PERIOD_S = 0.15
IDENTIFY_TIMEOUT_S = 5.0
"""Maximum time for the identification: a VESC that was just plugged in may be silent for seconds."""
REPLY_BUDGET_S = 0.02
"""Time without a reply after which the next request may be sent: at most one is ever pending."""
REOPEN_AFTER_S = (0.2, 0.5, 1.0)
"""Pauses before the attempts to reopen; the last one repeats."""
REVERSING_ABOVE_MPS = 0.3
"""Maximum speed for a reversal; a faster car is braked before it drives the other way: required by the drivetrain, and
by a sensorless motor's start."""

_ASK_FIRMWARE = codec.frame(codec.plain(codec.Packet.FW_VERSION))
_ASK_VALUES = codec.frame(codec.plain(codec.Packet.GET_VALUES))
_TODAYS_LAYOUT_SINCE_MAJOR = 3
_TIMER_EARLY_S = 1e-4
"""A loop's timer may end earlier than it was asked to: without this it would be asked for a pause of almost nothing."""
_SLACK_SHARE = 0.4
"""Share of its period by which a poll may come sooner or later: at 50 Hz it comes with every scan of a lidar of 40."""


class Vesc:
    """A VESC on a serial port; implements `wallride.drivers.api.Motor`.

    The VESC stops obeying by itself when no motor command came for its command timeout (1 s as shipped, after which it
    lets the car *coast*). Only motor commands feed that timeout: the polling here does not, this driver sends no
    keep-alive, and it never repeats a command, so the timeout remains a watchdog over this whole process. Set it to
    0.1-0.2 s with a real timeout brake current (5-15 A) in VESC Tool; no driver can check this setting. A timeout, a
    fault and a lost link all leave the *servo* at its last position.

    The only motor command of the driver's own is a brake, as the last command of a connection. While a fault is latched
    every command is carried out as a brake: the VESC alone would obey again after half a second.

    clear_s: moves the polling to a better moment. replied: called with the duration of every reply, after it is
        processed. firmware: of the controller that answered last. health: its condition, FAULTY while a fault is
        latched or there is no battery, and then it brakes or coasts. braked_instead: whether the last command was a
        brake in place of a speed that the VESC can hold.

    A reply with an implausible speed is refused: meanwhile the driver brakes, and lost_after_s later the link counts as
    lost. Command, speed and counters that contradict each other are a latched fault (`cross_check`).

    Counted in `health`: bad_command, fault, reboot, lost, reconnect, missed_reply, bad_reply, bad_counter,
    unasked_packet, skipped_bytes, checksum, brake_not_written.
    """

    def __init__(
        self,
        settings: VescSettings,
        *,
        clock: Clock = time.monotonic,
        clear_s: Reschedule = as_wanted,
        replied: Callable[[float], None] = lambda _took_s: None,
    ) -> None:
        self._settings = settings
        self._clock = clock
        self._clear_s = clear_s
        self._replied = replied
        self._address = parse_address(settings.address)
        self._calibration = Calibration(settings)
        self.health = Health()
        self._condition = VescMonitor(self._calibration, settings.min_voltage_v, self.health)
        self.inertia = Inertia(wanted=settings.imu)
        self.firmware: replies.Firmware | None = None
        self._link: ByteLink | None = None
        self._ready: ByteLink | None = None  # the same link, from the first report on: it takes commands
        self._steering_rad = 0.0
        self.braked_instead = False
        self._reopen_step = 0
        self.tap: Tap | None = None
        self._begin_session()

    def _begin_session(self) -> None:
        self._deframer = codec.VescDeframer()
        self._decode: Callable[[bytes], replies.Values | None] | None = None  # known once the firmware is
        self._identified: asyncio.Future[replies.Firmware] | None = None
        self._awaiting = False
        self._noise_bytes = 0
        self._heard_s = self._replied_s = self._asked_s = self._next_poll_s = self._clock()

    @property
    def state(self) -> MotorState | None:
        """The newest report, or None while disconnected or before the first."""
        return self._condition.state

    def send(self, drive: Drive) -> bool:
        """Write motor command and servo position at once, in one write; False when the VESC is not connected.

        A speed of 0, one too small for the VESC to hold, and one against the present motion are brakes. So is a NaN or
        infinite command ("bad_command"); its steering is replaced by the last good one. A stop brakes a standing car,
        too: locked wheels read 0.
        """
        link = self._ready
        if link is None:
            return False
        try:
            link.write(self._frames(drive))
        except LinkLost:  # the link itself ends the poll in run(), which reopens it
            self._ready = None
            return False
        self._condition.asked(drive.speed_mps)
        return True

    def brake_now(self) -> None:
        """Write one brake without the event loop: the last act of a process whose loop has ended. Never raises."""
        if self._link is not None and self._decode is not None:
            with contextlib.suppress(Exception):  # the VESC's own timeout remains
                self._link.write(self._calibration.brake)

    def latch_fault(self, words: str) -> None:
        """Latch a fault detected elsewhere; no effect where one is latched."""
        self._condition.latch(words)
        if self._ready is not None:
            self._tell_condition()

    def retry_fault(self) -> None:
        """Clear the latched fault if it is the controller's own."""
        if not self._condition.contradicts:
            self.clear_fault()

    def clear_fault(self) -> None:
        """Clear the latched fault; commands are obeyed again unless it is still present."""
        self._condition.clear_fault()
        if self._ready is not None:
            self._tell_condition()

    async def run(self) -> Never:
        """Maintain the connection; brakes and closes the port when cancelled."""
        while True:
            try:
                await self._connect_and_poll()
            except (LinkLost, ProtocolError) as error:
                self.health.message = str(error)
            await asyncio.sleep(REOPEN_AFTER_S[self._reopen_step])
            self._reopen_step = min(self._reopen_step + 1, len(REOPEN_AFTER_S) - 1)

    def _frames(self, drive: Drive) -> bytes:
        calibration = self._calibration
        try:
            steering_rad = calibration.allowed_steering_rad(drive.steering_rad)
            is_stop = calibration.is_stop(drive.speed_mps)
            self.braked_instead = not is_stop and self._must_brake(drive.speed_mps)
            if is_stop or self.braked_instead:
                motor = calibration.brake_frame(drive.brake_mps2)
            else:
                motor = calibration.speed_frame(drive.speed_mps)
        except ValueError:
            self.health.count("bad_command")
            self.braked_instead = True
            return calibration.brake + calibration.servo_frame(self._steering_rad)
        self._steering_rad = steering_rad
        return motor + calibration.servo_frame(steering_rad)

    def _must_brake(self, speed_mps: float) -> bool:
        """Tell whether a speed may not be held now."""
        if self._condition.fault or self._condition.blind:
            return True
        state = self._condition.state
        return state is not None and abs(state.speed_mps) > REVERSING_ABOVE_MPS and state.speed_mps * speed_mps < 0

    async def _connect_and_poll(self) -> Never:
        self._begin_session()
        self._link = link = await open_link(self._address, self._clock)
        link.tap = self.tap
        try:
            link.listen(self._on_bytes)
            self.health.link, self.health.message = LinkState.STARTING, f"{self._address}: asking who it is"
            self._accept(await self._identify(link))
            await self._poll(link)
        finally:
            self._hang_up(link)

    async def _identify(self, link: ByteLink) -> replies.Firmware:
        """Query the firmware until it answers. Nothing else is sent before: other devices share the VESC's USB id."""
        self._identified = asyncio.get_running_loop().create_future()
        lost = asyncio.ensure_future(link.lost())
        give_up_s = self._clock() + IDENTIFY_TIMEOUT_S
        try:
            while self._clock() < give_up_s:
                link.write(_ASK_FIRMWARE)
                await asyncio.wait(
                    (self._identified, lost), timeout=IDENTIFY_PERIOD_S, return_when=asyncio.FIRST_COMPLETED
                )
                if lost.done():
                    lost.result()
                if self._identified.done():
                    return self._identified.result()
        finally:
            lost.cancel()
        if self._noise_bytes:
            raise ProtocolError(
                f"{self._address}: talks, but not like a VESC (a lidar with the same USB id? check the udev rule)"
            )
        raise LinkLost(f"{self._address}: no answer to FW_VERSION (powered? is it a VESC? power-cycle it)")

    def _accept(self, firmware: replies.Firmware) -> None:
        kind = firmware.hardware_kind or replies.HARDWARE_VESC
        if kind != replies.HARDWARE_VESC:
            raise ProtocolError(
                f"{self._address}: is a {replies.HARDWARE_KINDS.get(kind, f'module of kind {kind}')}, no motor"
                " controller (another port? connect the VESC itself by USB)"
            )
        self.firmware = firmware
        is_old = firmware.major < _TODAYS_LAYOUT_SINCE_MAJOR
        self._decode = replies.decode_values_2x if is_old else replies.decode_values
        if self.health.identity:
            self.health.count("reconnect")
        name = f"VESC {firmware.hardware}".rstrip()
        self.health.identity = f"{name}, firmware {firmware.version}"

    async def _poll(self, link: ByteLink) -> Never:
        """Request values on absolute deadlines; LinkLost when the VESC stays silent."""
        period_s = 1.0 / self._settings.poll_hz
        self._asked_s = self._replied_s = self._clock()
        # on multiples of its period: together with other timers of this rate, because a wake-up is costly
        self._next_poll_s = self._asked_s // period_s * period_s
        await link.repeat(partial(self._ask, link, period_s))

    def _ask(self, link: ByteLink, period_s: float) -> float:
        """Send one request, unless a reply is still pending; return the pause, at most until the link is lost."""
        now_s = self._clock()
        if self._awaiting and now_s - self._asked_s >= REPLY_BUDGET_S:
            self._miss_reply(now_s)
        lost_s = self._replied_s + self._settings.lost_after_s
        if now_s >= lost_s - _TIMER_EARLY_S:
            raise LinkLost(self._why_lost())
        if not self._awaiting:
            self._awaiting = True
            self._asked_s = now_s
            link.write(_ASK_VALUES + self.inertia.question())
        self._next_poll_s = self._clear_s(max(self._next_poll_s + period_s, now_s), _SLACK_SHARE * period_s)
        return min(self._next_poll_s, lost_s) - now_s

    def _why_lost(self) -> str:
        what = f"{self._address}: no usable reply for {self._settings.lost_after_s:g} s from {self.health.identity}"
        refused_mps = self._condition.refused_mps
        if refused_mps is None:
            return f"{what} (cable, motor noise; power-cycle the VESC if it stays so)"
        return f"{what}: it reports {refused_mps:.3g} m/s (check motor.speed_to_erpm_gain; repeat the motor detection)"

    def _miss_reply(self, now_s: float) -> None:
        self._awaiting = False
        self.health.count("missed_reply")
        if now_s - self._heard_s >= REPLY_BUDGET_S:  # not in the middle of a slow frame: it will never be complete
            self._take(self._deframer.give_up(), now_s)

    def _on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        self._heard_s = read_at_s
        self._take(self._deframer.feed(chunk), read_at_s)

    def _take(self, payloads: list[bytes], stamp_s: float) -> None:
        for payload in payloads:
            self._on_payload(payload, stamp_s)
        deframer = self._deframer
        if deframer.skipped_bytes:
            self._noise_bytes += deframer.skipped_bytes
            self.health.count("skipped_bytes", deframer.skipped_bytes)
        if deframer.bad_checksums:
            self.health.count("checksum", deframer.bad_checksums)
        deframer.skipped_bytes = deframer.bad_checksums = 0

    def _on_payload(self, payload: bytes, stamp_s: float) -> None:
        if payload[0] == codec.Packet.GET_VALUES:
            self._on_values(payload, stamp_s)
        elif payload[0] == codec.Packet.GET_IMU_DATA:
            if not self.inertia.take(payload, stamp_s):
                self.health.count("bad_reply")
        elif payload[0] == codec.Packet.FW_VERSION:
            firmware = replies.decode_firmware(payload)
            if firmware is None:
                self.health.count("bad_reply")
            elif self._identified is not None and not self._identified.done():
                self._identified.set_result(firmware)
        else:
            self.health.count("unasked_packet")

    def _on_values(self, payload: bytes, stamp_s: float) -> None:
        if self._decode is None:  # a reply to the previous owner of the port
            self.health.count("unasked_packet")
            return
        values = self._decode(payload)
        if values is None:
            self.health.count("bad_reply")
            return
        self._awaiting = False
        if not self._condition.update(values, stamp_s, self._steering_rad):
            self.health.count("bad_reply")
            if self._ready is not None:
                self._tell_condition()
            return
        self._replied_s = stamp_s
        self._ready = self._link
        self._reopen_step = 0
        self._tell_condition()
        self._replied(stamp_s - self._asked_s)

    def _tell_condition(self) -> None:
        health, trouble = self.health, self._condition.trouble
        health.link, health.trouble = (LinkState.FAULTY if trouble else LinkState.READY), trouble
        health.message = f"{health.identity}: {trouble}" if trouble else health.identity

    def _hang_up(self, link: ByteLink) -> None:
        """Close the connection with a brake as the last motor command on the wire, in every case."""
        if self._ready is not None:
            self.health.count("lost")
        self._ready = self._link = None
        self._condition.disconnect()
        self.health.link, self.health.message = LinkState.ABSENT, f"{self._address}: closed"
        self.health.trouble = ""
        try:
            if self._decode is not None:  # other devices do not understand it
                link.write(self._calibration.brake)
        except LinkLost:
            self.health.count("brake_not_written")  # no link; the VESC's own timeout remains
        finally:
            link.close()
