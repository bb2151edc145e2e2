"""The page: asks nobody for anything, says the summary's numbers, and is small enough to mail."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tests.sim.conftest import DEAD_END
from tests.sim.replay.recorded import options as offline
from tests.sim.replay.recorded import record
from wallride.runtime.settings.tree import load_settings
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import DriveLog, decode, read_log
from wallride.sim.replay.figures import numbers, stops
from wallride.sim.replay.foreign import open_any
from wallride.sim.replay.run import run_of
from wallride.sim.run_report import command
from wallride.sim.run_report.moments import extremes
from wallride.sim.run_report.page import page
from wallride.sim.run_report.shown import shown


class Reader(HTMLParser):
    """Collects tags, text and the cells that carry a figure's name."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.cells, self._name = [], [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        self._name = dict(attrs).get("data-name")

    def handle_data(self, data):
        if self._name is not None:
            self.cells.setdefault(self._name, []).append(data)
            self._name = None


def data_of(text):
    """What the page's script reads."""
    return json.loads(re.findall(r'id="data">(.*?)</script>', text, re.DOTALL)[0])


@pytest.fixture(scope="module")
def text(run):
    return page(shown(run))


def test_it_asks_nobody_for_anything(text):
    reader = Reader(text)
    assert not {"img", "link", "iframe", "object", "embed", "video", "audio", "use", "image"} & set(reader.tags)
    assert not {"src", "href", "srcset", "action", "onload"} & {name for name, _ in reader.attributes}
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org/2000/svg)|fetch\(|XMLHttp|WebSocket", text)
    assert "default-src 'none'" in text


def test_every_section_is_there(text, run):
    for title in ("Figures", "Path", "Distance error over time", "How often which error", "Speed", "Who decided",
                  "From a scan to the motor", f"Stops ({len(stops(run))})", "The scan at each event"):  # fmt: skip
        assert f"<h2>{title}</h2>" in text
    assert text.count("<figure>") >= len(stops(run))
    assert all(stop.reason in text for stop in stops(run))


def test_its_numbers_are_those_of_the_summary(text, run):
    found = numbers(run)
    cells = Reader(text).cells
    for name in ("distance_m", "mean_abs_error_m", "rms_error_m", "mean_speed_mps", "min_clearance_m",
                 "max_overshoot_m"):  # fmt: skip
        assert float(cells[name][0].split()[0]) == pytest.approx(found[name], rel=0.005)
    for name, value in found["distance_error"].items():
        assert float(cells[f"distance_error.{name}"][0].split()[0]) == pytest.approx(value, rel=0.005)


def test_the_simulators_truth_stands_beside_it(run):
    truth = {"rms_error_m": 0.0312, "laps": 2, "lap_times_s": [20.1, 19.9], "collided": False}
    cells = Reader(page(shown(run, truth))).cells
    assert cells["rms_error_m"][1] == "0.0312 m"
    assert cells["laps"] == ["2"]
    assert cells["lap_times_s"] == ["20.1, 19.9 s"]
    assert cells["collided"] == ["no"]


def test_the_reasons_are_those_of_the_log(drive, text):
    *_, logged = drive
    assert len(logged) > 3
    told = data_of(text)["runs"][0]["decisions"]
    # The log has every change of mind; the recorded topic may leave out one that lasted less than its period.
    reasons = {f"{winner}: {why}" for _, winner, why, *_ in told}
    assert any(line.startswith("safety") for line in reasons)
    assert reasons <= set(logged)


def test_the_moments_hold_the_scan_as_it_was(path, text):
    scans = data_of(text)["runs"][0]["scans"]
    beams = np.frombuffer(base64.b64decode(scans["beams"]), "<u2").reshape(-1, scans["groups"])
    times_s = np.frombuffer(base64.b64decode(scans["t"]), "<f4")
    assert np.diff(times_s).max() < 0.15
    run = run_of(read_log(path))
    at = len(times_s) // 2
    message = min(run.scans, key=lambda scan: abs(scan[0] - times_s[at]))[1]
    ranges_m = np.asarray(decode(message).ranges)
    for group, packed in enumerate(beams[at].tolist()):
        index = group * scans["group"] + (packed >> 13)
        if range_m := (packed & 8191) / 100:
            assert range_m == pytest.approx(ranges_m[index], abs=0.006)
            assert range_m <= np.nanmin(ranges_m[group * scans["group"] : (group + 1) * scans["group"]]) + 0.006


def test_the_settings_that_differ_are_told(text):
    assert "<th>wall_follow.speed_mps</th><td>2</td><td>1</td>" in text
    assert "[wall_follow]" in text
    assert "<th>recording.start</th>" not in text


def test_two_runs_stand_side_by_side(run, tmp_path):
    record(tmp_path / "other.mcap", **{**DEAD_END, "seconds": 4.0, "sections": {"wall_follow": {"speed_mps": 1.0}}})
    other = run_of(read_log(tmp_path / "other.mcap"))
    written = page(shown(run, None, "A"), shown(other, None, "B"))
    assert [one["tag"] for one in data_of(written)["runs"]] == ["A", "B"]
    assert '<tr class="differs"><th>wall_follow.speed_mps</th><td>2</td><td>1</td><td>1</td></tr>' in written
    assert Reader(written).cells["distance_m"] == [f"{numbers(one)['distance_m']:.3g} m" for one in (run, other)]
    labels = [line["label"] for line in data_of(written)["charts"]["speed"]["lines"]]
    assert labels == ["A sent", "A driven", "B sent", "B driven"]


def test_world_and_laps_are_told_where_the_simulator_said_them(run):
    truth = {"world": "loop", "lap_times_s": [12.5, 11.5], "began_unix_s": run.zero_unix_s + 1.0}
    written = page(shown(run, truth))
    assert "world: loop · 2 laps, best 11.5 s" in written
    assert data_of(written)["runs"][0]["laps"] == [13.5, 25.0]


def test_a_race_has_its_laps_and_its_distance_from_the_line(run):
    sectors_s = {1: [3.1, 3.0, 3.1], 2: [2.8, 2.7, 2.9]}

    def race_of(laps, time_s, off_m):
        errors = {"rms_m": off_m, "largest_m": off_m}
        return {"laps": laps, "time_s": time_s, "sectors_s": sectors_s.get(laps, []), **errors}

    laps = [(1.0, 0, None, None), (4.0, 1, 9.2, 0.06), (6.0, 1, 9.2, 0.06), (8.0, 2, 8.4, 0.04)]
    told = [
        (at_s, {**run.status, "pose": {"race": race_of(done, took_s, rms_m)}}) for at_s, done, took_s, rms_m in laps
    ]
    race = replace(run, settings=load_settings(None, ["wall_follow.method=line"]), statuses=told)
    written = page(shown(race, {"laps": 2, "line_rms_m": 0.03}))
    cells = Reader(written).cells
    assert (cells["laps"], cells["lap_times_s"]) == (["2", "2"], ["9.2, 8.4 s"])
    assert [cells[f"sector_{k}_s"] for k in (1, 2, 3)] == [["3.1, 2.8 s"], ["3, 2.7 s"], ["3.1, 2.9 s"]]
    assert (cells["line_rms_m"], cells["line_largest_m"]) == (["0.04 m", "0.03 m"], ["0.04 m"])
    assert "<h2>Distance from the race line over time</h2>" in written
    assert "2 laps, best 8.4 s" in written
    assert "race line, at most 6 m/s" in written
    assert not {"settle_s", "max_overshoot_m", "mean_abs_error_m", "rms_error_m"} & set(cells)
    titles = re.findall("<tr><th>([^<]*)</th><td data-name", written)
    assert len(titles) == len(set(titles))


def test_a_long_line_keeps_its_extremes_and_its_gaps():
    value = np.sin(np.linspace(0, 60, 50_000))
    value[20_000], value[30_000:30_400] = 7.0, np.nan
    kept = value[extremes(value, 6000)]
    assert len(kept) <= 6000
    assert np.nanmax(kept) == 7.0
    assert np.isnan(kept).any()


def test_it_is_small(text):
    assert len(text) < 500_000


def test_what_people_wrote_is_text_and_not_markup(run, monkeypatch):
    monkeypatch.setattr(run, "name", "<b>&\"'")
    monkeypatch.setattr(run, "notes", ["<script>alert(1)</script>"])
    written = page(shown(run))
    assert "<script>alert" not in written
    assert "&lt;b&gt;&amp;" in written


def test_a_foreign_drive_has_a_page_too(carried_bag):
    told = run_of(open_any(carried_bag).log)
    written = page(shown(told))
    assert "driven by another program" in written
    assert "From a scan to the motor" not in written, "nobody measured it"


@pytest.fixture
def report(path, tmp_path):
    """The command, on the drive unless told otherwise."""

    def run(file=path, *, output=tmp_path / "run.html", summary=None, json=None, **changes):
        return command.run(offline(file, output=output, beside=None, summary=summary, json=json, **changes))

    return run


def test_the_command_writes_page_and_figures(report, tmp_path, capsys):
    target = tmp_path / "run.html"
    (tmp_path / "truth.json").write_text(json.dumps({"rms_error_m": 0.25}))
    assert report(summary=tmp_path / "truth.json", json=str(tmp_path / "figures.json")) == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    cells = Reader(target.read_text()).cells
    assert cells["rms_error_m"] == [f"{figures['rms_error_m']:.3g} m", "0.25 m"]
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", f"{target}: {len(target.read_text()) / 1000:.0f} kB\n")


def test_a_summary_beside_the_recording_is_found(report, path, tmp_path):
    copy = tmp_path / "drive.mcap"
    copy.write_bytes(path.read_bytes())
    (tmp_path / "drive.summary.json").write_text(json.dumps({"laps": 3}))
    assert report(copy, json="-") == 0
    assert Reader((tmp_path / "run.html").read_text()).cells["laps"] == ["3"]


@pytest.mark.parametrize("content", ["not json", "[1]"])
def test_what_is_no_summary_is_refused(report, tmp_path, content):
    (tmp_path / "truth.json").write_text(content)
    with pytest.raises(RecordingError, match=r"is no summary of `wallride sim --json`"):
        report(summary=tmp_path / "truth.json")


def test_a_summary_that_is_not_there_is_said_to_be_missing(report, tmp_path):
    with pytest.raises(RecordingError, match=r"--summary .*none\.json: there is no such file; `wallride sim --json`"):
        report(summary=tmp_path / "none.json")


def test_a_full_disk_is_blamed_on_the_page_and_not_on_the_recording(report):
    with pytest.raises(OSError, match="No space left") as full:
        report(output=Path("/dev/full"))
    assert full.value.filename == "/dev/full"


def test_settings_for_a_recording_that_has_its_own_are_refused(report):
    with pytest.raises(RecordingError, match="leave --set out"):
        report(assignments=["wall_follow.kp=9"])


def test_a_setting_that_was_changed_while_it_drove_is_told(tmp_path):
    def nearer(car):
        follow = car.settings.wall_follow.model_copy(update={"desired_distance_m": 0.8})
        car.apply(car.settings.model_copy(update={"wall_follow": follow}), ["wall_follow.desired_distance_m"])

    path = tmp_path / "tuned.mcap"
    record(path, seconds=3.0, events=[(2.0, nearer)])
    one = run_of(read_log(path))
    ((time_s, change),) = one.tuned
    assert (change.name, change.old, change.new) == ("wall_follow.desired_distance_m", 1.0, 0.8)
    assert time_s == pytest.approx(2.0, abs=0.3)
    written = page(shown(one))
    assert f"left wall at 1 m, from {time_s:.1f} s 0.8 m" in written
    assert f"less the wanted 1 m, from {time_s:.1f} s 0.8 m" in written
    assert "<td>wall_follow.desired_distance_m</td><td>1</td><td>0.8</td>" in written


def test_settings_of_a_newer_version_are_left_out_and_named(path, monkeypatch):
    written = read_log(path).settings_text
    for section, key in (("telemetry.rates_hz", "smell"), ("lidar", "nose"), ("wall_follow", "whiskers")):
        written = written.replace(f"[{section}]\n", f"[{section}]\n{key} = 5.0\n")
    monkeypatch.setattr(DriveLog, "settings_text", written)
    said = "lidar.nose, wall_follow.whiskers, telemetry.rates_hz.smell are not known to this version"
    assert f"its settings {said}: they are left out." in page(shown(run_of(read_log(path))))


def test_a_run_without_such_a_change_has_no_such_table(run):
    assert run.tuned == []
    assert "changed while it drove" not in page(shown(run))
