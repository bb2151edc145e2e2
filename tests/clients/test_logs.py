"""`wallride logs` and `wallride record` against a car's recorder over a real session, and on files here."""

import asyncio
import contextlib
import json
import re
import time

import pytest
from mcap.writer import CompressionType, Writer

from tests.clients.speaking_car import CarSession, client_bus
from tests.typed import typed
from wallride.clients import logs
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.log_info import describe
from wallride.runtime.realtime.wall_clock import NS, WallClock
from wallride.runtime.recording import channels
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.recording.recover import is_whole
from wallride.runtime.recording.requests import GET, LIST, MAX_PIECE_B, RECORD, TRIM
from wallride.runtime.settings.recording import RecordingSettings, recordings_folder
from wallride.runtime.tasks import recorder as recorder_task
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError


class Car(CarSession):
    """A recorder on a session of its own, and a client's command line."""

    def __init__(self, folder, **settings):
        super().__init__()
        given = {"folder": str(folder), "start": "request", "keep_free_mb": 0, **settings}
        self.recorder = Recorder(
            RecordingSettings(**given), car="car1", version="9.9",
            wall_clock=WallClock(time.monotonic), clock=time.monotonic,
        )  # fmt: skip

    def serve(self):
        recorder_task.serve(self.bus, "car1", self.recorder)
        self.recorder.start()

    async def __aexit__(self, *_):
        await asyncio.to_thread(self.recorder.close, 5.0)
        await super().__aexit__()

    async def run(self, *words):
        """Return exit code and lines of a command."""
        said = []
        here = "--local" in words or words[1] in {"info", "recover"}
        options = typed(*words, *(() if here else ("--connect", self.endpoint)))
        options.print_line, options.progress = said.append, lambda *_: None
        program = logs.record if words[0] == "record" else logs.run
        return await program(options), "\n".join(said).splitlines()

    async def recorded(self, messages=2000):
        """Record something and return the file's name."""
        assert (await self.run("record", "start"))[0] == 0
        name = self.recorder.status()["file"]
        for number in range(messages):
            self.recorder.take(
                topics.STATUS, "", time.monotonic(), json.dumps({"number": number, "fill": "x" * 200}).encode()
            )
        assert (await self.run("record", "stop"))[0] == 0
        return name


async def test_a_recording_is_begun_ended_listed_fetched_read_and_deleted(tmp_path):
    async with Car(tmp_path / "car") as car:
        code, (line,) = await car.run("record", "status")
        assert (code, line) == (0, "not recording: request")
        code, (line,) = await car.run("record", "start")
        assert code == 0
        assert line.startswith("recording: asked for; 2")
        assert json.loads((await car.run("record", "status", "--json"))[1][0])["on"] is True
        code, lines = await car.run("logs", "list")
        assert code == 0
        assert lines[0].endswith("recording")
        assert (await car.run("record", "stop"))[0] == 0
        name = await car.recorded()
        (tmp_path / "car" / "notes.txt").write_text("not ours")
        code, lines = await car.run("logs", "list")
        assert [word for line in lines for word in line.split() if word.endswith(".mcap")] == sorted(
            path.name for path in (tmp_path / "car").glob("*.mcap")
        )
        assert lines[-1].startswith("2 recordings, ")
        code, (path,) = await car.run("logs", "get", "-o", str(tmp_path / "here"))
        assert path == str(tmp_path / "here" / "car1" / name)
        assert (tmp_path / "here" / "car1" / name).read_bytes() == (tmp_path / "car" / name).read_bytes()
        code, lines = await car.run("logs", "info", path)
        assert lines[1] == "recording of car1, wallride 9.9"
        assert any("/status" in line and " 2000 " in line for line in lines)
        code, lines = await car.run("logs", "trim", "--keep-mb", "0")
        assert len(lines) == 2
        assert not list((tmp_path / "car").glob("*.mcap"))
        assert (await car.run("logs", "trim", "--keep-mb", "0"))[1] == ["nothing to delete"]


async def test_a_fetch_that_was_interrupted_goes_on_where_it_was(tmp_path):
    async with Car(tmp_path / "car") as car:
        name = await car.recorded()
        whole = (tmp_path / "car" / name).read_bytes()
        begun = whole[:MAX_PIECE_B] + bytes(100_000 - MAX_PIECE_B)
        (tmp_path / "car1").mkdir()
        (tmp_path / "car1" / f"{name}.part").write_bytes(begun)
        await car.run("logs", "get", name, "-o", str(tmp_path))
        here = (tmp_path / "car1" / name).read_bytes()
        assert here == begun + whole[100_000:], "what is here is not fetched again"


async def test_another_recording_of_the_same_name_is_neither_continued_nor_taken_for_it(tmp_path):
    async with Car(tmp_path / "car") as car:
        name = await car.recorded()
        whole = (tmp_path / "car" / name).read_bytes()
        place = tmp_path / "car1" / name
        place.parent.mkdir()
        place.with_name(f"{name}.part").write_bytes(bytes(100_000))
        await car.run("logs", "get", name, "-o", str(tmp_path))
        assert place.read_bytes() == whole, "another car's bytes are not gone on from"
        place.write_bytes(bytes(len(whole)))
        with pytest.raises(ConnectionProblemError, match="is another recording of that name"):
            await car.run("logs", "get", name, "-o", str(tmp_path))


async def test_a_file_that_is_still_written_comes_as_far_as_it_is_and_whole(tmp_path):
    async with Car(tmp_path / "car") as car:
        await car.run("record", "start")
        for number in range(2000):
            car.recorder.take(topics.STATUS, "", time.monotonic(), b'{"number":%d}' % number)
        told = ""
        async with asyncio.timeout(30):
            while not re.search(r"/status +std_msgs/msg/String +2000 ", told):  # it reaches the disk twice a second
                _, (path,) = await car.run("logs", "get", "-o", str(tmp_path))
                assert is_whole(type(tmp_path)(path))
                with contextlib.suppress(ConnectionProblemError):  # it holds no message yet
                    told = "\n".join((await car.run("logs", "info", path))[1])


@pytest.mark.parametrize(
    "name",
    ["../../etc/passwd", "/etc/passwd", "counts.json", "..", "", "a/20260921T141500Z-b0001-00001.mcap",
     "20260921T141500Z-b0001-00001.mcap/../counts.json", "20260921T141500Z-b0001-00001.mcap\n"],
)  # fmt: skip
async def test_no_name_leads_out_of_the_folder(tmp_path, name):
    async with Car(tmp_path / "car") as car, client_bus(car.endpoint) as client:
        with pytest.raises(RefusedError, match="not the name of a recording"):
            await client.ask(topics.key("car1", GET), json.dumps({"name": name, "offset": 0}).encode())


async def test_a_link_in_the_folder_is_not_followed(tmp_path):
    async with Car(tmp_path / "car") as car, client_bus(car.endpoint) as client:
        (tmp_path / "car").mkdir(exist_ok=True)
        (tmp_path / "secret").write_text("secret")
        link = tmp_path / "car" / "20260921T141500Z-b0001-00001.mcap"
        link.symlink_to(tmp_path / "secret")
        with pytest.raises(RefusedError):
            await client.ask(topics.key("car1", GET), json.dumps({"name": link.name, "offset": 0}).encode())
        assert json.loads((await client.ask(topics.key("car1", LIST)))[0])["files"] == []


@pytest.mark.parametrize(
    ("what", "question"),
    [
        (GET, b'{"name":"20260921T141500Z-b0001-00001.mcap","offset":0}'),
        (GET, b'{"name":"x","offset":-1}'),
        (GET, b'{"name":"x","offset":0,"length":10000000}'),
        (GET, b"[]"),
        (TRIM, b"{}"),
        (TRIM, b'{"keep_mb":-1}'),
        (RECORD, b'{"on":"yes"}'),
        (RECORD, b'{"on":true,"by_itself":true}'),
        (RECORD, b"nonsense"),
        (LIST, b'{"folder":"/"}'),
        (LIST, b" " * 2000),
    ],
)
async def test_what_cannot_be_answered_is_refused(tmp_path, what, question):
    async with Car(tmp_path / "car") as car, client_bus(car.endpoint) as client:
        with pytest.raises(RefusedError):
            await client.ask(topics.key("car1", what), question)


async def test_a_car_that_does_not_record_says_so(tmp_path):
    async with Car(tmp_path / "car", enabled=False) as car:
        with pytest.raises(ConnectionProblemError, match="recording is turned off"):
            await car.run("record", "start")
        assert (await car.run("logs", "list"))[0] == 0


async def test_a_car_cannot_choose_where_files_are_written_here(tmp_path):
    file = {"name": "../evil.mcap", "size_bytes": 1, "black_box": False, "reason": "", "state": "whole"}
    async with CarSession() as car:
        car.bus.answer(topics.key("car1", LIST), lambda _: topics.encode({"folder": "/", "files": [file]}))
        with pytest.raises(ConnectionProblemError, match="not the name of a recording"):
            await logs.run(typed("logs", "get", "--connect", car.endpoint, "-o", tmp_path / "here"))


async def test_files_of_this_machine(tmp_path):
    async with Car(tmp_path) as car:
        name = await car.recorded()
        _, lines = await car.run("logs", "list", "--local", str(tmp_path))
        assert name in lines[0]
        listed = json.loads("\n".join((await car.run("logs", "list", "--local", str(tmp_path), "--json"))[1]))
        assert listed[0]["state"] == "whole"
        path = tmp_path / name
        info = json.loads("\n".join((await car.run("logs", "info", "--json", str(path)))[1]))
        assert listed[0]["duration_s"] == pytest.approx(info["seconds"], abs=0.001)
        assert f" {info['seconds']:.1f} s  {name}" in lines[0]
        assert lines[0] == (await car.run("logs", "list"))[1][0], "the car says the same of its own files"
        path.write_bytes(path.read_bytes()[:-20_000])
        assert "without its end" in (await car.run("logs", "info", str(path)))[1][1]
        torn = (await car.run("logs", "list", "--local", str(tmp_path)))[1][0]
        assert f"MB          -  {name}   unfinished" in torn
        code, (line,) = await car.run("logs", "recover", str(path))
        assert code == 0
        assert "finished; " in line
        assert "is whole" in (await car.run("logs", "recover", str(path)))[1][0]
        assert (await car.run("logs", "trim", "--local", str(tmp_path), "--keep-mb", "0"))[1] == [f"deleted {name}"]
        (tmp_path / "x.mcap").write_bytes(b"nonsense")
        code, (line,) = await car.run("logs", "recover", str(tmp_path / "x.mcap"))
        assert code == 1
        assert "not an MCAP file" in line
        with pytest.raises(ConnectionProblemError, match="holds no message"):
            await car.run("logs", "info", str(tmp_path / "x.mcap"))
        with pytest.raises(ConnectionProblemError, match="no such file"):
            await car.run("logs", "info", "nowhere.mcap")


def test_where_recordings_are_kept():
    assert str(recordings_folder("/data/drives", {})) == "/data/drives"
    assert str(recordings_folder("", {"STATE_DIRECTORY": "/var/lib/wallride"})) == "/var/lib/wallride/recordings"
    assert str(recordings_folder("", {"XDG_DATA_HOME": "/home/ann/data"})) == "/home/ann/data/wallride/recordings"
    assert str(recordings_folder("", {})).endswith("/.local/share/wallride/recordings")


@pytest.mark.parametrize("damaged_ns", [5, 2**63 + 5])
def test_a_damaged_time_is_no_part_of_a_recordings_length(damaged_ns, tmp_path):
    path, event = tmp_path / "a.mcap", channels.text(b'{"event": "stop", "reason": "damaged"}')
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel(f"/{channels.EVENTS}", "cdr", 0)
        for stamp_ns in (*(1_800_000_000 * NS + at_s * NS for at_s in range(3)), damaged_ns):
            writer.add_message(channel, stamp_ns, event, stamp_ns)
        writer.finish()
    found = json.loads(describe(path, as_json=True))
    assert (found["seconds"], found["messages"]) == (2.0, 4)
    assert [stop["at_s"] for stop in found["stops"]] == [0.0, 1.0, 2.0]


def test_the_newest_to_get_is_a_drive_and_a_black_box_only_where_it_is_asked_for():
    files = [logs.ListedRecording(name, 1, name > "b", "", "whole") for name in ("a1", "a2", "b1")]
    for words, names in (((), ["a2"]), (("--last", "5"), ["a1", "a2"]), (("--black-boxes",), ["b1"])):
        assert [one.name for one in logs._chosen(files, typed("logs", "get", *words))] == names


@pytest.mark.parametrize("piece", [0, 2])
def test_a_damaged_piece_is_counted_and_what_is_behind_it_is_read(piece, tmp_path):
    path, words = tmp_path / "a.mcap", [f"word {k}".encode() * 100 for k in range(5)]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=100, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("events", "cdr", schema)
        for k, word in enumerate(words):
            writer.add_message(channel, 1_800_000_000 * NS + k, word, 0)
        writer.finish()
    path.write_bytes(path.read_bytes().replace(words[piece], words[piece].swapcase()))
    found = json.loads(describe(path, as_json=True))
    assert (found["messages"], found["damaged_pieces"]) == (4, 1)
    assert "\n1 damaged pieces are left out\n" in describe(path, as_json=False)
