"""Layers, and messages that name the key and the remedy."""

import os
import re
from pathlib import Path

import pytest

from tests.own_laws import EASY, STRAIGHT
from wallride.runtime.arbitration.command import LAB_ORDER, Source
from wallride.runtime.control.method_settings import METHODS, name_of
from wallride.runtime.control.report.settings import ReportFollowSettings
from wallride.runtime.control.vehicle import NAME_RULE
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings, to_toml

ROOT = Path(__file__).resolve().parents[3]


def test_the_car_needs_a_permit_and_the_simulation_does_not():
    assert load_settings(ROOT / "config" / "car.toml").operator.permit == "required"
    assert load_settings(ROOT / "config" / "sim.toml").operator.permit == "always"
    assert Settings().operator.permit == "required"


def test_what_is_printed_loads_again(tmp_path):
    settings = load_settings(ROOT / "config" / "sim.toml", ["wall_follow.side=right", "mux.tick_hz=40"])
    path = tmp_path / "again.toml"
    path.write_text(to_toml(settings))
    assert load_settings(path) == settings


def test_later_layers_win(file):
    file.write_text("[wall_follow]\nkp = 2.0\nkd = 2.0\n")
    settings = load_settings(file, ["wall_follow.kp=3", "wall_follow.side=right", 'car.name="my-car"'])
    assert (settings.wall_follow.kp, settings.wall_follow.kd) == (3.0, 2.0)
    assert (settings.wall_follow.side, settings.car.name) == ("right", "my-car")


def order(*names):
    return f"mux.order={list(names)}"


@pytest.fixture
def file(tmp_path):
    return tmp_path / "car.toml"


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("wall_follow.sped_mps=1", ["wall_follow.sped_mps", "not a setting", "speed_mps"]),
        ("wal_follow.speed_mps=1", ["wal_follow", "not a setting", "wall_follow"]),
        ("wall_follow.speed_mps=-1", ["wall_follow.speed_mps = -1", "greater than or equal to 0"]),
        ("wall_follow.speed_mps=fast", ["wall_follow.speed_mps = 'fast'", "valid number"]),
        ("wall_follow.speed_mps=nan", ["wall_follow.speed_mps", "finite"]),
        ("wall_follow.side=up", ["wall_follow.side = 'up'", "'left' or 'right'"]),
        ("wall_follow.method=magic", ["wall_follow.method = 'magic'", "'report'"]),
        ("lidar.address=tpc://192.168.0.10:10940", ["lidar.address", "tpc", "tcp://HOST:PORT"]),
        ("lidar.address=tcp://192.168.0.10", ["lidar.address", "port"]),
        ("motor.address=tcp://1.2.3.4:5", ["motor.address", "serial:///dev/"]),
        ("motor.address=serial://dev/ttyACM0", ["motor.address", "three slashes"]),
        ("mux.order=[\"safety\", \"teleop\"]", ["mux.order", "exactly once"]),
        (order("teleop", "e-stop", "safety", "permit", "navigation"), ["mux.order", "begin with e-stop"]),
        (order("e-stop", "teleop", "navigation", "safety", "permit"), ["mux.order", "before navigation"]),
        ("operator.permit=maybe", ["operator.permit", "'required' or 'always'"]),
        ("wall_follow", ["--set wall_follow", "SECTION.KEY=VALUE"]),
        ("=1", ["SECTION.KEY=VALUE"]),
        ("wall_follow.kp.x=1", ["wall_follow.kp"]),
    ],
)  # fmt: skip
def test_a_wrong_value_is_one_clear_message(assignment, words):
    with pytest.raises(SettingsError) as caught:
        load_settings(None, [assignment])
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, ["no such file", "config/car.toml"]),
        (lambda path: path.mkdir(), ["is a directory"]),
        (lambda path: path.write_text("[wall_follow\n"), ["not valid TOML"]),
        (lambda path: path.write_bytes(b"\xff\xfe\x00"), ["not text in UTF-8"]),
        (lambda path: path.write_text("wall_follow = 3\n"), ["wall_follow"]),
    ],
)
def test_an_unusable_file_is_one_clear_message(file, make, words):
    make(file)
    with pytest.raises(SettingsError) as caught:
        load_settings(file)
    assert all(word in str(caught.value) for word in [*words, str(file)])


def test_binding_teleop_moves_safety_above_it():
    assert Settings().effective_order() == (Source.ESTOP, Source.BATTERY, *LAB_ORDER[1:])
    bound = Settings.model_validate({"safety": {"binds_teleop": True}}).effective_order()
    assert bound == (Source.ESTOP, Source.BATTERY, Source.SAFETY, Source.TELEOP, Source.PERMIT, Source.NAVIGATION)
    mine = ["e-stop", "safety", "teleop", "permit", "navigation"]
    assert Settings.model_validate({"mux": {"order": mine}}).effective_order() == ("e-stop", "battery", *mine[1:])


def test_each_wrong_value_is_blamed_on_where_it_was_written(tmp_path):
    file, saved = tmp_path / "car.toml", tmp_path / "saved.toml"
    file.write_text("[wall_follow]\nkp = 999\n")
    saved.write_text("[wall_follow]\nkd = 999\n")
    with pytest.raises(SettingsError) as caught:
        load_settings(file, ["wall_follow.speed_mps=999"], saved)
    said = str(caught.value)
    for where, key in ((file, "wall_follow.kp"), (saved, "wall_follow.kd"), ("--set", "wall_follow.speed_mps")):
        assert f"{where}: {key} = 999" in said
    with pytest.raises(SettingsError, match=r"^--set: lidar = 3: is a section"):
        load_settings(None, ["lidar=3"])


@pytest.mark.parametrize("name", ["my car", "Car1", "", "a" * 33, "-car"])
def test_a_wrong_name_of_a_car_is_answered_with_the_rule_in_words(file, name):
    file.write_text(f'[car]\nname = "{name}"\n')
    with pytest.raises(SettingsError) as caught:
        load_settings(file)
    assert str(caught.value).endswith(f"car.name = {name!r}: must be {NAME_RULE}, for example car1")


@pytest.mark.parametrize("key", ["telemetry.rates_hz.line", "map.line"])
def test_a_key_with_the_name_of_a_law_is_named_whole(key):
    with pytest.raises(SettingsError, match=rf"{re.escape(key)} = 500: "):
        load_settings(None, [f"{key}=500"])


GAINS = '[wall_follow]\nmethod = "ball"\nside = "right"\nkp = 13.5\nkd = 4.5\n'


def test_another_law_on_the_command_line_takes_no_gains_of_the_files_law(file):
    file.write_text(GAINS)
    chosen = load_settings(file, ["wall_follow.method=report", "wall_follow.kd=0.5"]).wall_follow
    assert (chosen.side, chosen.kp, chosen.kd) == ("right", ReportFollowSettings().kp, 0.5)
    assert load_settings(file, ["wall_follow.method=ball"]).wall_follow.kp == 13.5


def test_a_law_of_the_users_takes_the_place_of_the_files_on_the_command_line(file, law_file):
    file.write_text(GAINS + "[safety]\ngrip_mu = 0.5\nfront_margin_m = 0.08\n")
    settings = load_settings(file, [f"wall_follow.method={law_file(STRAIGHT)}", f"safety.method={law_file(EASY)}"])
    assert settings.wall_follow.side == "right"
    assert (settings.safety.grip_mu, settings.safety.front_margin_m) == (0.5, 0.08)


def test_gains_left_in_the_file_of_an_own_law_are_told_with_the_remedy(file, law_file):
    file.write_text(GAINS.replace("ball", law_file(STRAIGHT)))
    having = " and ".join(name_of(law) for law in METHODS["wall_follow"] if "kp" in law.model_fields)
    with pytest.raises(SettingsError, match=rf"wall_follow\.kp is a setting of {having}; delete it"):
        load_settings(file)


@pytest.mark.parametrize(
    ("section", "others"), [("lidar", "hokuyo and rplidar and ydlidar and auto"), ("motor", "vesc and maestro")]
)
def test_an_address_beside_an_own_driver_is_told_its_place(section, others):
    said = f"{section}.address is a setting of {others}; delete it, or write it below [{section}.own]. Known here: "
    with pytest.raises(SettingsError, match=re.escape(said)):
        load_settings(None, [f"{section}.driver=my:Driver", f"{section}.address=serial:///dev/port"])
    with pytest.raises(SettingsError, match=r"lidar\.address is a setting of .*; delete it\. Known here"):
        load_settings(None, ["lidar.driver=topic", "lidar.address=serial:///dev/port"])


def test_a_setting_that_is_gone_is_named_with_the_remedy(file):
    file.write_text("[process]\nprefetch = true\n")
    with pytest.raises(SettingsError, match=r"car\.toml: process\.prefetch is not a setting any more; delete it$"):
        load_settings(file)


def test_a_byte_order_mark_is_no_part_of_the_file(file):
    file.write_text("[wall_follow]\nside = 'right'\n", encoding="utf-8-sig")
    assert load_settings(file).wall_follow.side == "right"


@pytest.mark.timeout(10)
def test_a_pipe_without_a_writer_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "car.toml")
    with pytest.raises(SettingsError, match=r"car\.toml: is not a settings file: it is a pipe$"):
        load_settings(tmp_path / "car.toml")


def test_a_file_without_an_end_is_refused_and_not_read_for_ever():
    with pytest.raises(SettingsError, match=r"^/dev/zero: is not a settings file: it is longer than 1 MB$"):
        load_settings(Path("/dev/zero"))


@pytest.mark.parametrize("other", ["serial:///dev/port", "serial:///dev/port?baud=460800"])
def test_one_address_for_two_devices_is_refused_and_blamed_on_the_file(file, other):
    file.write_text(f"[lidar]\naddress = 'serial:///dev/port'\n[motor]\naddress = '{other}'\n")
    words = r"car\.toml: lidar\.address and motor\.address are the same: name the port of each device$"
    with pytest.raises(SettingsError, match=words):
        load_settings(file)
    load_settings(file, ["motor.address=serial:///dev/other"])
    load_settings(file, ["motor.driver=maestro"])
    load_settings(file, ["lidar.driver=auto", "lidar.address="])
    load_settings(file, ["motor.driver=my_motor:Motor", "motor.own.address=serial:///dev/port"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[car]\nmax_speed_mps = true", "car.max_speed_mps = True: input should be a valid number, without quotes"),
        ('[wall_follow]\nkp = "7"', "wall_follow.kp = '7': input should be a valid number"),
        ('[safety]\nbinds_teleop = "off"', "safety.binds_teleop = 'off': must be true or false"),
        ("[safety]\nbinds_teleop = 0", "safety.binds_teleop = 0: must be true or false"),
        ("[car]\nfront_m = 0.1", "[car]: front_m = 0.1 is less than wheelbase_m = 0.33: measure it from the rear"),
        ("[car]\nlidar_x_m = 0.5", "[car]: front_m = 0.42 is less than lidar_x_m = 0.5"),
        ("[recording]\nring_mb = true", "recording.ring_mb = True: input should be a valid number"),
    ],
)
def test_a_value_of_another_kind_and_an_outline_that_cannot_be_are_refused(file, text, words):
    file.write_text(text)
    with pytest.raises(SettingsError, match=re.escape(words)):
        load_settings(file)
    file.write_text("[wall_follow]\nspeed_mps = 2")
    assert load_settings(file).wall_follow.speed_mps == 2.0
