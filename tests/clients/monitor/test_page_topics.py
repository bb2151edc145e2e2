"""The page reads each topic that the monitor sends, shows it, and has the elements that its code fills."""

import re
from pathlib import Path

from wallride.clients.monitor.outbox import TOPICS
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics

PAGE = Path(__file__).resolve().parents[3] / "clients" / "monitor" / "page"
CODE = {path.name: path.read_text(encoding="utf-8") for path in PAGE.rglob("*.js")}
ALL_CODE = "\n".join(CODE.values())
NEWEST = CODE["link.js"].partition("newest = {")[2].partition("\n  };")[0]
DECODED = set(re.findall(r"(\w+): new \w+\(\)", NEWEST))
TAKE = CODE["main.js"].partition("const TAKE = {")[2].partition("\n};")[0]
TAKEN = set(re.findall(r"^  (\w+)[(:]", TAKE, re.MULTILINE))


def test_a_topic_that_is_not_json_has_its_decoder():
    binary = {topic for topic in TOPICS if topic in TYPES or topic == topics.BEAT}
    lacking = sorted(binary - DECODED)
    assert not lacking, f"add {lacking} to `newest` in clients/monitor/page/link.js, with a decoder of cdr.js"
    unsent = sorted(DECODED - set(TOPICS))
    assert not unsent, (
        f"add {unsent} to TOPICS in clients/monitor/outbox.py, or take it out of `newest` in page/link.js"
    )


def test_every_topic_is_shown():
    shown = {*TAKEN, *re.findall(r"\bnewest\.(\w+)", ALL_CODE)}
    shown |= {
        name for names in re.findall(r"\{([\w, ]+)\} = \S*newest", ALL_CODE) for name in re.findall(r"\w+", names)
    }
    lacking = sorted(set(TOPICS) - shown)
    assert not lacking, f"add {lacking} to TAKE in clients/monitor/page/main.js: it is sent for nothing"
    unsent = sorted(TAKEN - set(TOPICS))
    assert not unsent, f"add {unsent} to TOPICS in clients/monitor/outbox.py: nothing sends it"


def test_every_element_that_the_code_names_is_in_the_page():
    there = set(re.findall(r'id="([\w-]+)"', (PAGE / "index.html").read_text(encoding="utf-8")))
    lacking = sorted(set(re.findall(r'\$\("([\w-]+)"\)', ALL_CODE)) - there)
    assert not lacking, f"add an element of each id of {lacking} to clients/monitor/page/index.html"
