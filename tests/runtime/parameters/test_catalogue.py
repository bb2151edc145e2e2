"""The catalogue of settings, what becomes of wishes, and which of them loosen safety."""

import json
from pathlib import Path

import pytest

from wallride.runtime.control.method_settings import METHODS, name_of
from wallride.runtime.parameters.catalogue import ValueKind, catalogue, values
from wallride.runtime.parameters.policy import LOOSENS, Effect, Loosens, effect_of, is_looser, loosens_by
from wallride.runtime.parameters.update import UnacceptableError, looser, plan, read_texts
from wallride.runtime.settings.tree import Settings, load_settings

ROOT = Path(__file__).resolve().parents[3]
SETTINGS = Settings()
FOLLOWERS = " or ".join(f"'{name_of(law)}'" for law in METHODS["wall_follow"])
BY_LAW = {
    f"{section} {name_of(law)}": Settings.model_validate({section: {"method": name_of(law)}})
    for section, laws in METHODS.items()
    for law in laws
}
of_every_law = pytest.mark.parametrize("settings", BY_LAW.values(), ids=BY_LAW)


@of_every_law
def test_it_lists_every_value_of_the_tree_once(settings):
    def leaves(tree, above=""):
        for name, value in tree.items():
            yield from leaves(value, f"{above}{name}.") if isinstance(value, dict) else [(above + name, value)]

    assert values(settings) == dict(leaves(settings.model_dump(mode="json")))


@of_every_law
def test_every_setting_has_a_sentence(settings):
    assert [name for name, parameter in catalogue(settings).items() if not parameter.words] == []


@of_every_law
def test_everything_about_every_setting_is_json(settings):
    now = values(settings)
    for name, parameter in catalogue(settings).items():
        said = json.loads(json.dumps(parameter.describe(now[name]), allow_nan=False))
        assert said["name"] == name
        assert said["range"]
        assert parameter.takes(now[name])


@pytest.mark.parametrize(
    ("name", "kind", "default", "range_words", "unit", "effect"),
    [
        ("wall_follow.kp", ValueKind.NUMBER, 13.5, "a number from 0 to 20 rad/m", "rad/m", Effect.NOW),
        ("wall_follow.kd", ValueKind.NUMBER, 4.5, "a number from 0 to 20", "1", Effect.NOW),
        ("wall_follow.side", ValueKind.CHOICE, "left", "'left' or 'right'", "", Effect.NOW),
        ("wall_follow.method", ValueKind.CHOICE, "ball", FOLLOWERS, "", Effect.STANDING),
        ("wall_follow.expires_after_s", ValueKind.NUMBER, 0.15, "a number above 0 and at most 0.2 s", "s", Effect.NOW),
        ("safety.recovery.tries", ValueKind.INTEGER, 6, "a whole number from 0 to 10", "", Effect.NOW),
        ("safety.backs_out", ValueKind.BOOLEAN, True, "true or false", "", Effect.NOW),
        ("car.max_speed_mps", ValueKind.NUMBER, 4.0, "a number above 0 and at most 20 m/s", "m/s", Effect.NOW),
        ("car.wheelbase_m", ValueKind.NUMBER, 0.33, "a number above 0.05 and at most 2 m", "m", Effect.RESTART),
        ("motor.brake_mps2_per_a", ValueKind.NUMBER, 0.17, "a number above 0 and at most 5 m/s2/A", "m/s2/A",
         Effect.RESTART),
        ("lidar.address", ValueKind.TEXT, "tcp://192.168.0.10:10940", "a text", "", Effect.RESTART),
        ("operator.permit", ValueKind.CHOICE, "required", "'required' or 'always'", "", Effect.RESTART),
        ("log.level", ValueKind.CHOICE, "INFO", "'DEBUG' or 'INFO' or 'WARNING' or 'ERROR'", "", Effect.NOW),
    ],
)  # fmt: skip
def test_what_is_said_about_a_setting(name, kind, default, range_words, unit, effect):
    found = catalogue(SETTINGS)[name]
    assert (found.kind, found.default, found.range_words(), found.unit, found.effect) == (
        kind, default, range_words, unit, effect,
    )  # fmt: skip


def test_rates_of_telemetry_take_effect_at_once():
    assert effect_of("telemetry.rates_hz.scan") is Effect.NOW
    assert effect_of("telemetry.listen") is Effect.RESTART


def test_the_text_under_a_field_is_its_description_also_when_a_base_class_has_it():
    known = catalogue(SETTINGS)
    assert known["wall_follow.kp"].words.startswith("Gain of the distance error")
    assert known["wall_follow.expires_after_s"].words.startswith("Lifetime of a navigation command")
    assert known["motor.poll_hz"].words == "Rate of reading the VESC's values."


@of_every_law
def test_what_selects_a_law_says_what_each_is(settings):
    known = catalogue(settings)
    first = "Wall-following law. ball: the rolling ball, the default. report: the lab report's follower."
    assert known["wall_follow.method"].words.startswith(first)
    for section, laws in METHODS.items():
        for law in laws:
            summary = law.__doc__.partition(".")[0]
            assert f"{name_of(law)}: {summary[0].lower()}{summary[1:]}. " in known[f"{section}.method"].words


def test_a_wish_is_planned_and_what_it_was_is_told():
    wanted = plan(SETTINGS, {"wall_follow.kp": 0.5, "safety.recovery.tries": 2, "wall_follow.kd": 4.5})
    assert wanted.changed == (("wall_follow.kp", 13.5, 0.5), ("safety.recovery.tries", 6, 2))
    assert (wanted.settings.wall_follow.kp, SETTINGS.wall_follow.kp) == (0.5, 13.5)


@pytest.mark.parametrize(
    ("wishes", "words"),
    [
        ({"wall_follow.kp": 99}, ["wall_follow.kp = 99: must be a number from 0 to 20 rad/m"]),
        ({"wall_follow.kp": True}, ["wall_follow.kp = True", "from 0 to 20"]),
        ({"wall_follow.kp": "0.5"}, ["wall_follow.kp = '0.5'", "a number from 0 to 20"]),
        ({"wall_follow.kp": float("nan")}, ["wall_follow.kp = nan", "from 0 to 20"]),
        ({"wall_follow.kp": 10**400}, ["wall_follow.kp = 1000"]),
        ({"wall_follow.kp": None}, ["wall_follow.kp = None"]),
        ({"safety.recovery.tries": 2.5}, ["safety.recovery.tries = 2.5", "a whole number from 0 to 10"]),
        ({"safety.backs_out": 1}, ["safety.backs_out = 1", "true or false"]),
        ({"wall_follow.side": "up"}, ["wall_follow.side = 'up'", "'left' or 'right'"]),
        ({"wall_follow.method": "magic"}, ["wall_follow.method = 'magic'", FOLLOWERS]),
        ({"wall_follow.method": ["ball"]}, ["wall_follow.method", FOLLOWERS]),
        ({"wall_follow.kpp": 1}, ["wall_follow.kpp is not a setting; did you mean wall_follow.kp?", "known in"]),
        ({"wal.kp": 1}, ["wal.kp is not a setting", "sections: car, lidar"]),
        ({"wall_follow": 1}, ["wall_follow is not a setting"]),
        ({"wall_follow.kp.x": 1}, ["wall_follow.kp.x is not a setting"]),
        ({"": 1}, ["is not a setting"]),
        ({"\ud800\n": 1}, ["is not a setting"]),
        ({"motor.servo_min": 0.9}, ["motor.servo_min = 0.9", "servo_min 0.9 must be below servo_max 0.85"]),
        ({"mux.order": ["teleop"]}, ["mux.order", "exactly once"]),
        ({"mux.order": ["x", "teleop", "safety", "permit", "navigation"]}, ["mux.order", "'e-stop'"]),
        ({"car.name": "No!"}, ["car.name = 'No!'", "pattern"]),
        ({"wall_follow.kp": 99, "safety.grip_mu": 9}, ["kp = 99", "; ", "safety.grip_mu = 9", "0.2 to 1.5"]),
        ({"wall_follow.kp": 1, "safety.grip": 9}, ["safety.grip is not a setting"]),
        ({"wall_follow.method": "report", "wall_follow.look_ahead_m": 1}, ["look_ahead_m is not a setting"]),
    ],
)  # fmt: skip
def test_a_wrong_wish_is_refused_with_what_is_allowed(wishes, words):
    with pytest.raises(UnacceptableError) as caught:
        plan(SETTINGS, wishes)
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert "\n" not in message


def test_rules_between_keys_are_judged_on_all_wishes_together():
    both = plan(SETTINGS, {"motor.servo_min": 0.86, "motor.servo_max": 0.95, "motor.steering_to_servo_offset": 0.9})
    assert both.settings.motor.servo_min == 0.86


def test_another_method_begins_with_its_own_gains_and_keeps_what_means_the_same():
    settings = plan(SETTINGS, {"wall_follow.side": "right", "wall_follow.kp": 0.7}).settings
    wanted = plan(settings, {"wall_follow.method": "report", "wall_follow.kd": 2.0})
    follow = wanted.settings.wall_follow
    assert (follow.method, follow.side, follow.kp, follow.kd) == ("report", "right", 1.5, 2.0)
    assert ("wall_follow.look_ahead_m", 0.4, None) in wanted.changed
    back = plan(wanted.settings, {"wall_follow.method": "ball"})
    assert ("wall_follow.look_ahead_m", None, 0.4) in back.changed


def test_a_speed_beyond_those_of_another_method_is_not_kept_by_it():
    settings = Settings.model_validate({"wall_follow": {"method": "line", "side": "right", "speed_mps": 11.0}})
    read_texts(settings)
    follow = plan(settings, {"wall_follow.method": "ball"}).settings.wall_follow
    assert (follow.method, follow.side, follow.speed_mps) == ("ball", "right", 1.0)


@of_every_law
def test_for_every_safety_setting_it_is_written_down_what_loosens_it(settings):
    for name in catalogue(settings):
        if name.startswith("safety."):
            assert name in LOOSENS, f"say in runtime/parameters/policy.py which change of {name} loosens safety"


def test_no_rule_is_about_a_setting_that_does_not_exist():
    known = {name for settings in BY_LAW.values() for name in catalogue(settings)}
    gone = sorted(set(LOOSENS) - known)
    assert not gone, f"take {gone} out of LOOSENS in runtime/parameters/policy.py: there is no such setting"


@of_every_law
def test_every_rule_fits_the_type_of_its_setting(settings):
    for name, parameter in catalogue(settings).items():
        if parameter.loosens in {Loosens.UP, Loosens.DOWN}:
            assert parameter.kind in {ValueKind.NUMBER, ValueKind.INTEGER}, name
        if parameter.loosens in {Loosens.TO_TRUE, Loosens.TO_FALSE}:
            assert parameter.kind is ValueKind.BOOLEAN, name


def test_an_unknown_safety_setting_is_loosened_by_any_change():
    assert loosens_by("safety.brand_new") is Loosens.ANY
    assert loosens_by("wall_follow.brand_new") is Loosens.NEVER


@pytest.mark.parametrize(
    ("name", "old", "new", "loose"),
    [
        ("safety.grip_mu", 0.8, 0.9, True),
        ("safety.grip_mu", 0.8, 0.7, False),
        ("safety.grip_mu", 0.8, 0.8, False),
        ("safety.grip_mu", None, 0.8, True),
        ("safety.side_margin_m", 0.04, 0.03, True),
        ("safety.side_margin_m", 0.04, 0.05, False),
        ("safety.binds_teleop", True, False, True),
        ("safety.binds_teleop", False, True, False),
        ("safety.backs_out", False, True, True),
        ("safety.cornering_per_rad", 5.5, 5.4, True),
        ("safety.method", "swept", "report", True),
        ("car.max_speed_mps", 4.0, 5.0, True),
        ("car.max_speed_mps", 4.0, 3.0, False),
        ("wall_follow.kp", 0.3, 3.0, False),
    ],
)
def test_which_changes_loosen_a_limit(name, old, new, loose):
    assert is_looser(name, old, new) is loose


def test_the_loosened_limits_of_a_plan_are_named():
    wanted = plan(SETTINGS, {"safety.grip_mu": 0.9, "safety.hold_s": 0.3, "wall_follow.kp": 3})
    assert looser(wanted) == ["safety.grip_mu"]


@pytest.mark.parametrize("name", ["car.toml", "sim.toml"])
def test_the_shipped_files_can_be_listed(name):
    settings = load_settings(ROOT / "config" / name)
    assert values(settings).keys() == catalogue(settings).keys()
