"""A recording on zenoh: heard under the car's own keys, byte for byte, and steered by questions and by keys."""

import asyncio
import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import wallride
from tests.sim.replay.recorded import options
from tests.typed import telling
from tests.waiting import until
from wallride.clients import logs, parameters, status
from wallride.clients.connection import Cars, ConnectionProblemError
from wallride.clients.fleet import cars, stop
from wallride.clients.played import NOTHING_DRIVES, PlayedNames
from wallride.clients.remote import driver, planner
from wallride.clients.remote.driver import DriveRefusedError
from wallride.clients.remote.planner import PlanRefusedError
from wallride.clients.teleop import app
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.recordings import RecordingError
from wallride.sim.replay import publish
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.player import Player
from wallride.sim.replay.publish import Broadcast

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
async def playing(dead_end, monkeypatch):
    """A player on the air, and a client that hears all of it."""
    monkeypatch.setattr(publish, "single_keys", lambda: None)
    endpoint = free_endpoint()
    player = Player(read_log(dead_end), asyncio.get_running_loop().time, loops=True)
    stage = Broadcast(player, "car1", endpoint)
    task = asyncio.create_task(stage.run())
    await until(lambda: stage.bus.is_open or task.done())
    client = Bus(zenoh_config.client_config(endpoint, None))
    await client.open()
    yield player, client
    await client.close()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


async def test_it_is_heard_as_the_car_would_be(playing, dead_end):
    _, client = playing
    heard = []
    present = Cars(client)
    client.subscribe("wallride/car1/*", lambda key, payload, _: heard.append((key, payload)))
    needed = {topics.key("car1", topic) for topic in (topics.SCAN, topics.STATUS, topics.OUTPUT)}
    await until(lambda: needed <= {key for key, _ in heard})
    recorded = {(topics.key("car1", message.topic), message.payload) for message in read_log(dead_end).messages}
    assert set(heard) <= recorded, "the very bytes of the recording"
    assert not any(key.endswith(("/tape", "/settings")) for key, _ in heard)
    await until(lambda: "car1" in present.names)


async def test_questions_steer_it_and_nonsense_is_refused(playing):
    player, client = playing
    key = topics.key("car1", "replay")
    (answer,) = await client.ask(key, b'{"pause": true, "seek_s": 4}', timeout_s=5)
    assert json.loads(answer)["position_s"] == 4.0
    assert player.paused
    with pytest.raises(RefusedError, match="ask for"):
        await client.ask(key, b'{"fly": 1}', timeout_s=5)
    with pytest.raises(RefusedError):
        await client.ask(key, b"not json", timeout_s=5)
    (answer,) = await client.ask(key, timeout_s=5)
    assert json.loads(answer)["paused"]


async def test_a_standing_picture_is_sent_again_for_who_comes_late(playing):
    player, client = playing
    player.paused = True
    player.seek(3.0)
    await asyncio.sleep(0)
    scans = []
    client.subscribe(topics.key("car1", topics.SCAN), lambda _, payload, __: scans.append(payload))
    await until(lambda: len(scans) >= 3)
    assert len(set(scans)) == 1


def test_it_ends_with_the_recording(dead_end, monkeypatch, capsys):
    monkeypatch.setattr(publish, "single_keys", lambda: None)
    assert publish.play(options(dead_end)) == 0
    assert "playing car1 on tcp/127.0.0.1:" in capsys.readouterr().out


@pytest.mark.parametrize("listen", ["tls/127.0.0.1:7447", "tcp/0.0.0.0:7447", "nonsense"])
def test_it_is_for_this_machine_only(dead_end, listen):
    with pytest.raises(RecordingError, match="--listen"):
        publish.play(options(dead_end, listen=listen))


def test_keys_work_in_a_real_terminal_and_the_terminal_is_left_as_it_was(dead_end):
    master, slave = pty.openpty()
    script = (
        "import argparse; from wallride import replay_options; p = argparse.ArgumentParser();"
        "c = p.add_subparsers(); replay_options.add(c); o = p.parse_args(); raise SystemExit(o.run(o))"
    )
    command = [sys.executable, "-c", script, "replay", str(dead_end), "--publish", "--listen", free_endpoint()]
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, cwd=ROOT)
    os.close(slave)
    said = b""
    try:
        for awaited, keys in ((b"page keys", b" \x1b[C"), (b"paused      5.0 of", b"q")):
            while awaited not in said:
                said += os.read(master, 4096)
            os.write(master, keys)
        assert process.wait(15) == 0
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        os.close(master)


async def test_no_command_takes_a_recording_for_a_car_that_drives(playing, tmp_path, monkeypatch):
    monkeypatch.setattr(stop, "GIVE_UP_S", 0.8)
    script = tmp_path / "hands.csv"
    script.write_text("time_s,buttons,speed,steering\n0,manual,1,0\n")
    _, client = playing
    at = ("--connect", client.endpoint)
    parsed, said = telling("status", *at)
    assert await status.run(parsed) == 0
    assert said[0].splitlines()[0] == f"car1: {NOTHING_DRIVES}. What follows is its status of then."
    for arguments in (("stop", *at), ("stop", "--all", *at), ("stop", "--car", "car1", *at)):
        parsed, said = telling(*arguments)
        assert await stop.run(parsed) == 1
        assert said == [f"car1             {NOTHING_DRIVES}"]
    parsed, said = telling("cars", *at)
    assert await cars.run(parsed) == 0
    assert NOTHING_DRIVES in said[0]
    for program, arguments in (
        (app.operate, ("teleop", "--script", str(script), *at)),
        (parameters.run, ("param", "get", "wall_follow.kp", *at)),
        (logs.record, ("record", "status", *at)),
    ):
        parsed, said = telling(*arguments)
        with pytest.raises(ConnectionProblemError, match=f"car1 at .*: {NOTHING_DRIVES}$"):
            await program(parsed)


async def test_a_script_is_told_that_what_it_would_drive_is_a_recording(playing, monkeypatch):
    for block in (driver, planner):
        monkeypatch.setattr(block, "READY_WITHIN_S", 0.3)
    _, client = playing

    def script():
        with wallride.connect(at=client.endpoint) as car:
            for block, refused in ((car.drive(), DriveRefusedError), (car.plan("slam"), PlanRefusedError)):
                with pytest.raises(refused, match=f"^car1 cannot be .* now: {NOTHING_DRIVES}$"), block:
                    pass
            with pytest.raises(ConnectionProblemError, match=f"^car1: {NOTHING_DRIVES}; it answers no questions$"):
                car.parameters["wall_follow.kp"]

    await asyncio.to_thread(script)


async def test_a_car_that_is_heard_is_no_recording_whatever_is_announced(speaking_beats):
    bus, client = speaking_beats
    played = PlayedNames(client)
    bus.announce(topics.key("car1", topics.PLAYED))
    await until(lambda: played._announced and "car1" not in played)
    assert list(played) == []


@pytest.fixture
async def speaking_beats():
    """A session that sends heartbeats as a car does, and a client."""
    bus = Bus(zenoh_config.car_config([free_endpoint()], None, (), "car1"))
    await bus.open()
    client = Bus(zenoh_config.client_config(bus.endpoint, None))
    await client.open()

    async def beat():
        while True:
            bus.put(topics.key("car1", topics.BEAT), b"beat", urgent=True)
            await asyncio.sleep(0.02)

    beating = asyncio.create_task(beat())
    yield bus, client
    beating.cancel()
    await client.close()
    await bus.close()


@pytest.mark.parametrize("text", ["nan", "9999", "-1"])
def test_a_beginning_outside_the_recording_is_refused_with_its_range(dead_end, text):
    with pytest.raises(RecordingError, match=rf"--from {text} is not in it: give seconds from 0 to \d+\.\d\."):
        publish.play(options(dead_end, begin_s=float(text)))
