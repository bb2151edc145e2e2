"""The page: asks nobody for anything, says the summary's numbers, and is small enough to mail."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from sim.recordings import RecordingError
from sim.replay.figures import numbers, stops
from sim.replay.opening import open_any
from sim.replay.run import run_of
from sim.run_report import command
from sim.run_report.page import page
from tests.sim.replay.recorded import options as offline

BAG = Path(__file__).resolve().parents[2] / "data" / "urg04lx_people_40.bag"


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


@pytest.fixture(scope="module")
def text(run):
    return page(run, numbers(run))


def test_it_asks_nobody_for_anything(text):
    reader = Reader(text)
    assert not {"script", "img", "link", "iframe", "object", "embed", "video", "audio", "use", "image"} & set(
        reader.tags
    )
    assert not {"src", "href", "srcset", "action", "onload"} & {name for name, _ in reader.attributes}
    assert not re.search(r"url\(|@import|https?://", text)
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
    for name in (
        "distance_m",
        "mean_abs_error_m",
        "rms_error_m",
        "mean_speed_mps",
        "min_clearance_m",
        "max_overshoot_m",
    ):
        assert float(cells[name][0].split()[0]) == found[name]
    for name, value in found["distance_error"].items():
        assert float(cells[f"distance_error.{name}"][0].split()[0]) == value


def test_the_simulators_truth_stands_beside_it(run):
    truth = {"rms_error_m": 0.0312, "laps": 2, "lap_times_s": [20.1, 19.9], "collided": False}
    cells = Reader(page(run, numbers(run), truth)).cells
    assert cells["rms_error_m"][1] == "0.0312 m"
    assert cells["laps"] == ["2"]
    assert cells["lap_times_s"] == ["20.1, 19.9 s"]
    assert cells["collided"] == ["no"]


def test_it_is_small(text):
    assert len(text) < 500_000


def test_what_people_wrote_is_text_and_not_markup(run, monkeypatch):
    monkeypatch.setattr(run, "name", "<b>&\"'")
    monkeypatch.setattr(run, "notes", ["<script>alert(1)</script>"])
    written = page(run, numbers(run))
    assert "<script" not in written
    assert "&lt;b&gt;&amp;" in written


def test_somebody_elses_drive_has_a_page_too():
    told = run_of(open_any(BAG).log)
    written = page(told, numbers(told))
    assert "driven by another program" in written
    assert "From a scan to the motor" not in written, "nobody measured it"


def test_the_command_writes_page_and_figures(path, tmp_path, capsys):
    target = tmp_path / "run.html"
    (tmp_path / "truth.json").write_text(json.dumps({"rms_error_m": 0.25}))
    given = offline(path, output=target, summary=tmp_path / "truth.json", json=str(tmp_path / "figures.json"))
    assert command.run(given) == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    cells = Reader(target.read_text()).cells
    assert cells["rms_error_m"] == [f"{figures['rms_error_m']:g} m", "0.25 m"]
    assert capsys.readouterr().out == ""


def test_a_summary_beside_the_recording_is_found(path, tmp_path):
    copy = tmp_path / "drive.mcap"
    copy.write_bytes(path.read_bytes())
    (tmp_path / "drive.summary.json").write_text(json.dumps({"laps": 3}))
    assert command.run(offline(copy, output=tmp_path / "run.html", summary=None, json="-")) == 0
    assert Reader((tmp_path / "run.html").read_text()).cells["laps"] == ["3"]


@pytest.mark.parametrize("content", ["not json", "[1]"])
def test_what_is_no_summary_is_refused(path, tmp_path, content):
    (tmp_path / "truth.json").write_text(content)
    with pytest.raises(RecordingError, match=r"is no summary of `wallride sim --json`"):
        command.run(offline(path, output=tmp_path / "run.html", summary=tmp_path / "truth.json", json=None))


def test_a_place_that_cannot_be_written_is_refused_first(path, tmp_path):
    with pytest.raises(RecordingError, match="name a file in a folder that is there"):
        command.run(offline(path, output=tmp_path / "nowhere" / "run.html", summary=None, json=None))
