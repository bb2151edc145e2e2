"""A controller that falls silent, is unplugged, deaf or noisy, and how the driver leaves it."""

import asyncio
import os
import tty
from pathlib import Path

import pytest

from tests.drivers.vesc.rig import BRAKE, CENTRE, PATIENCE_S, commands, controller, ready, running, seen, sent, vesc_at
from tests.waiting import until
from wallride.drivers.api import Drive, LinkState
from wallride.drivers.vesc import codec, driver
from wallride.drivers.vesc.codec import Packet, frame
from wallride.drivers.vesc.condition import VescMonitor


async def test_the_distance_survives_a_reboot_and_a_lost_link(emulator):
    emulator.report(tachometer=70_000)
    async with ready(emulator) as vesc:
        metres_per_step = 10 / 4614
        emulator.report(tachometer=70_900)
        await until(lambda: seen(vesc).distance_m == pytest.approx(900 * metres_per_step))
        emulator.reboot()
        await until(lambda: vesc.health.counts.get("reboot") == 1)
        emulator.report(tachometer=70_700)
        await until(lambda: seen(vesc).distance_m == pytest.approx(700 * metres_per_step))
        emulator.replug()
        await until(lambda: vesc.health.counts.get("reconnect") == 1 and vesc.state is not None)
        assert seen(vesc).distance_m == pytest.approx(700 * metres_per_step)


async def test_polling_does_not_keep_the_motor_alive(tmp_path):
    emulator = controller(tmp_path, timeout_s=0.15, timeout_brake_a=8.0)
    emulator.start()
    async with ready(emulator) as vesc:
        vesc.send(Drive(1.0, 0.0))
        await until(lambda: not seen(vesc).timed_out)
        await until(lambda: seen(vesc).timed_out)  # nothing but polls went out meanwhile
        assert emulator.motor_wire() == [codec.set_erpm(4614)]
        vesc.send(Drive(1.0, 0.0))
        await until(lambda: not seen(vesc).timed_out)
    emulator.close()


async def test_unplug_and_replug(emulator):
    async with ready(emulator) as vesc:
        emulator.unplug()
        await until(lambda: vesc.health.link is LinkState.ABSENT)
        assert vesc.state is None
        assert vesc.send(Drive(1.0, 0.0)) is False
        await until(lambda: "no such device" in vesc.health.message)
        wired = len(commands(emulator))
        emulator.start()
        await until(lambda: vesc.health.link is LinkState.READY)
        assert len(commands(emulator)) == wired  # nothing was queued
        assert await sent(vesc, emulator, Drive(1.0, 0.0)) == [codec.set_erpm(4614), CENTRE]
        assert (vesc.health.counts["lost"], vesc.health.counts["reconnect"]) == (1, 1)


async def test_the_first_attempt_after_every_loss_comes_soon(emulator, monkeypatch):
    monkeypatch.setattr(driver, "REOPEN_AFTER_S", (0.01, 10 * PATIENCE_S))
    async with ready(emulator) as vesc:
        for losses in range(3):
            await until(lambda: vesc.state is not None)
            assert vesc.health.counts.get("reconnect", 0) == losses
            emulator.replug()
            await until(lambda: vesc.state is None)


async def test_a_false_start_does_not_swallow_reply_after_reply(emulator):
    async with ready(emulator, poll_hz=10) as vesc:
        emulator.write(b"\x03\x01\xf0")  # "496 bytes follow"
        emulator.report(erpm=4614)
        await until(lambda: seen(vesc).speed_mps == 1.0)
        assert vesc.health.counts["missed_reply"] <= 3
        assert vesc.health.counts["skipped_bytes"] == 3


async def test_silence_is_a_lost_link_left_with_a_brake_and_reopened(emulator):
    async with ready(emulator, lost_after_s=0.2) as vesc:
        vesc.send(Drive(1.0, 0.0))
        emulator.silent = True
        await until(lambda: "no usable reply for 0.2 s" in vesc.health.message)
        assert vesc.state is None
        await until(lambda: emulator.motor_wire()[-1] == BRAKE)
        assert vesc.health.counts["missed_reply"] >= 3
        emulator.silent = False
        await until(lambda: vesc.health.link is LinkState.READY)


async def test_one_missed_reply_is_counted_and_forgiven(emulator):
    async with ready(emulator) as vesc:
        emulator.silent = True
        await until(lambda: vesc.health.counts.get("missed_reply"))
        emulator.silent = False
        stamp_s = seen(vesc).stamp_s
        await until(lambda: seen(vesc).stamp_s > stamp_s)
        assert "lost" not in vesc.health.counts


async def test_a_device_that_takes_no_more_bytes_is_lost(emulator):
    async with ready(emulator) as vesc:
        emulator.deaf = True
        async with asyncio.timeout(PATIENCE_S):
            while vesc.send(Drive(1.0, 0.0)):
                pass
        os.read(emulator.fileno(), 4096)  # there is room again, but half a frame was written: not one byte more
        assert vesc.send(Drive(1.0, 0.0)) is False
        await until(lambda: "stopped taking bytes" in vesc.health.message)
        emulator.deaf = False
        await until(lambda: vesc.health.link is LinkState.READY)


@pytest.mark.parametrize(("trouble", "counted"), [("noise", "skipped_bytes"), ("dribble", None)])
async def test_it_lives_with_noise_and_dribble(emulator, trouble, counted):
    setattr(emulator, trouble, True)
    async with ready(emulator) as vesc:
        stamp_s = seen(vesc).stamp_s
        await until(lambda: seen(vesc).stamp_s > stamp_s + 0.1)
        if counted:
            assert vesc.health.counts[counted] > 0


async def test_bad_checksums_are_counted_and_never_believed(emulator):
    async with ready(emulator) as vesc:
        emulator.bad_crc = True
        emulator.report(erpm=9999)
        await until(lambda: vesc.health.counts.get("checksum", 0) >= 2)
        assert seen(vesc).speed_mps == 0.0


async def test_a_bug_comes_out_of_run_after_a_brake(emulator, monkeypatch):
    vesc = vesc_at(emulator.link)
    task = asyncio.ensure_future(vesc.run())
    await until(lambda: vesc.health.link is LinkState.READY)

    def buggy(*_: object) -> None:
        raise KeyError("bug")

    monkeypatch.setattr(VescMonitor, "update", buggy)
    with pytest.raises(KeyError):
        async with asyncio.timeout(PATIENCE_S):
            await task
    await until(lambda: emulator.motor_wire() == [BRAKE])


async def test_an_answer_meant_for_an_earlier_user_of_the_port_is_not_believed():
    master, slave = os.openpty()
    tty.setraw(slave)
    vesc = vesc_at(Path(os.ttyname(slave)))
    async with running(vesc):
        await until(lambda: vesc.health.link is LinkState.STARTING)
        os.write(master, frame(bytes((Packet.GET_VALUES,)) + bytes(73)))
        await until(lambda: vesc.health.counts.get("unasked_packet") == 1)
        assert (vesc.state, vesc.health.link) == (None, LinkState.STARTING)
    os.close(master)
    os.close(slave)


async def test_unasked_text_and_useless_replies_are_counted_and_passed_over(emulator):
    async with ready(emulator) as vesc:
        emulator.transmit(b"\x15Warning")
        emulator.transmit(b"\x04\x00")
        emulator.transmit(b"\x00\x06")
        await until(lambda: vesc.health.counts.get("bad_reply") == 2)
        assert vesc.health.counts["unasked_packet"] == 1
        assert vesc.health.link is LinkState.READY


async def test_the_last_brake_needs_no_loop_and_no_living_controller(emulator):
    async with ready(emulator) as vesc:
        vesc.send(Drive(1.0, 0.0))
        await until(lambda: emulator.demand(asyncio.get_running_loop().time()).kind == "speed")
        await asyncio.to_thread(vesc.brake_now)  # a thread without a loop, as a process whose loop has ended
        await until(lambda: commands(emulator)[-1] == BRAKE)
        emulator.close()
        vesc.brake_now()
    vesc.brake_now()
