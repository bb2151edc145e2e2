import pytest

from tests.docs.test_source_rules import ROOT
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.script import Script, ScriptError, Step, load

CSV = "time_s,buttons,speed,steering\n0,,0,0\n0.5,LB,0,0\n1,manual,0.5,-0.2\n2,RB+start,,\n3,,0,0\n"
TOML = """
[[step]]
time_s = 0
[[step]]
time_s = 0.5
buttons = ["LB"]
[[step]]
time_s = 1
buttons = ["manual"]
speed = 0.5
steering = -0.2
[[step]]
time_s = 2
buttons = ["RB", "start"]
[[step]]
time_s = 3
"""


@pytest.mark.parametrize(("name", "text"), [("a.csv", CSV), ("a.toml", TOML)])
def test_both_notations_say_the_same(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    script = load(path)
    assert script.duration_s == 3
    told = [
        (sorted(i.pressed), i.speed, i.steering) for i in (script.inputs(t, 50 + t) for t in (-1, 0.6, 1.5, 2.5, 3))
    ]
    assert told == [
        ([], 0, 0),
        ([Control.MANUAL], 0, 0),
        ([Control.MANUAL], 0.5, -0.2),
        ([Control.AUTONOMY, Control.RESET], 0, 0),
        ([], 0, 0),
    ]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "time_s,speed\n", "empty"),
        ("a.csv", "time_s,speed\n0,fast\n", "step 1: speed = 'fast' is not a number"),
        ("a.csv", "time_s,speed\n0,1.5\n", "not between"),
        ("a.csv", "time_s,speed\n,1\n", "step 1: time_s"),
        ("a.csv", "time_s,buttons\n0,LB+hoot\n", "'hoot' is no button"),
        ("a.csv", "time_s,colour\n0,red\n", "unknown 'colour'"),
        ("a.csv", "time_s\n1\n1\n", "does not come after"),
        ("a.csv", "time_s\n\xff\n", "a.csv: is not a script: it is not text in UTF-8"),
        ("a.csv", "time_s\n" + "1" * 200_000, "a.csv: field larger than field limit"),
        ("a.toml", "step = 3", "a list of"),
        ("a.toml", "[[step", "a.toml"),
    ],
)
def test_a_script_that_cannot_be_followed_is_named(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ScriptError, match=words.replace("[", "\\[")):
        load(path)


def test_a_mark_at_the_beginning_is_no_part_of_a_script(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,buttons\n0.0,manual\n", encoding="utf-8-sig")
    load(path)


def test_a_script_that_is_not_there(tmp_path):
    with pytest.raises(ScriptError, match="cannot be read"):
        load(tmp_path / "none.csv")


def test_nothing_is_held_after_the_end():
    script = Script([Step(0.0, frozenset({Control.MANUAL}), 1.0), Step(1.0, frozenset({Control.MANUAL}), 1.0)])
    assert script.inputs(1.0, 5.0).released


@pytest.mark.parametrize("notation", ["csv", "toml"])
def test_the_scripts_in_the_documentation_are_read_and_permit_autonomy(tmp_path, notation):
    page = (ROOT / "docs" / "driving.md").read_text(encoding="utf-8")
    file = tmp_path / f"script.{notation}"
    file.write_text(page.partition(f"```{notation}\n")[2].partition("```")[0], encoding="utf-8")
    script = load(file)
    assert script.inputs(1.0, 0.0).pressed == {Control.AUTONOMY}
    assert script.duration_s in {20.0, 22.0}
