"""`wallride import`: parameter files of both ROS generations to our settings, and what is said of the rest."""

import tomllib

import pytest

from wallride.bringup.import_options import KINDS
from wallride.bringup.ros_mapping import RosParameter, convert, parameters
from wallride.cli import main
from wallride.runtime.settings.tree import load_settings
from wallride.service.parts import shipped

ROS_2 = """
/**:
  ros__parameters:
    speed_to_erpm_gain: 4200.0
    speed_to_erpm_offset: 10.0
    steering_angle_to_servo_gain: -1.1
    steering_angle_to_servo_offset: 0.48
    speed_min: -2100.0
    speed_max: 12600.0
    servo_min: 0.2
    servo_max: 0.8
    brake_max: 200000.0
ns/vesc_to_odom_node:
  ros__parameters: {wheelbase: 0.325, publish_tf: true}
urg_node:
  ros__parameters: {ip_address: 192.168.1.11, ip_port: 10941, cluster: 1}
smoother:
  ros__parameters: {max_acceleration: 2.0, max_servo_speed: 3.0, throttle_smoother_rate: 75.0}
"""
ROS_1 = """
speed_to_erpm_gain: 4200
steering_angle_to_servo_gain: -1.1
steering_angle_to_servo_offset: 0.48
wheelbase: .25
tachometer_ticks_to_meters_gain: 0.00225
vesc_driver: {port: /dev/ttyACM0, speed_min: -2100, speed_max: 12600, servo_min: 0.2, servo_max: 0.8}
"""
LAB = "wall_follower:\n  ros__parameters:\n    side: -1\n    velocity: 0.8\n    desired_distance: 0.6\n    kp: 1.0\n"
JOY_1 = """
teleop:
  drive:
    deadman_buttons: [4]
    axis_mappings:
      - {axis: 1, target: drive.speed, scale: 1.5, offset: 0.0}
      - {axis: 3, target: drive.steering_angle, scale: 0.3}
"""
JOY_2 = """
joy_teleop:
  ros__parameters:
    human:
      axis_mappings:
        drive-speed: {axis: 1, scale: 1.5}
        drive-steering_angle: {axis: 2, scale: 0.3}
"""


def imported(tmp_path, capsys, *texts, options=()):
    """Run the command on files with these texts; return code, settings, and what it said of the rest."""
    files = []
    for number, text in enumerate(texts):
        files.append(tmp_path / f"{number}.yaml")
        files[-1].write_text(text)
    code = main(["import", *map(str, files), *options])
    told = capsys.readouterr()
    return code, told.out, told.err


def test_a_map_is_refused_by_name(tmp_path, capsys):
    code, out, err = imported(tmp_path, capsys, "image: lab.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n")
    file = tmp_path / "0.yaml"
    assert (code, out) == (2, "")
    assert err == f'wallride: {file}: is a map, not parameters: name it in the settings, map.file = "{file}"\n'


def test_values_that_the_settings_refuse_are_told_of_what_was_read(tmp_path, capsys):
    code, out, err = imported(tmp_path, capsys, "vesc_driver:\n  servo_min: 0.85\n  servo_max: 0.15\n")
    assert (code, out) == (2, "")
    assert err.startswith("wallride: what was read: ")
    assert "imported.toml" not in err


def test_a_long_wheelbase_makes_a_long_car_that_is_to_be_measured(tmp_path, capsys):
    code, out, err = imported(tmp_path, capsys, "vesc_to_odom:\n  ros__parameters:\n    wheelbase: 0.5\n")
    assert code == 0, err
    assert "front_m = 0.59" in out
    assert "look at    car.front_m = 0.59: as far beyond the front axle as usual: measure it" in err


def test_a_ros_2_file(tmp_path, capsys):
    code, out, err = imported(tmp_path, capsys, ROS_2)
    assert code == 0
    assert tomllib.loads(out) == {
        "motor": {
            "speed_to_erpm_gain": 4200.0, "speed_to_erpm_offset": 10.0, "steering_to_servo_gain": -1.1,
            "steering_to_servo_offset": 0.48, "servo_min": 0.2, "servo_max": 0.8,
        },
        "car": {
            "max_reverse_mps": 0.5, "max_speed_mps": 3.0, "wheelbase_m": 0.325, "max_acceleration_mps2": 2.0,
            "steering_rate_radps": 3.0,
        },
        "lidar": {"address": "tcp://192.168.1.11:10941"},
    }  # fmt: skip
    assert "not taken  /**.brake_max: a limit inside the VESC" in err
    assert "urg_node.cluster: there is no such setting" in err
    assert "ip_address" not in err


def test_a_ros_1_file_of_the_same_car_gives_the_same_settings(tmp_path, capsys):
    _, out, err = imported(tmp_path, capsys, ROS_1)
    told = tomllib.loads(out)
    assert told["car"] == {"wheelbase_m": 0.25, "max_reverse_mps": 0.5, "max_speed_mps": 3.0}
    assert told["motor"]["steering_to_servo_offset"] == 0.48
    assert "look at    car.wheelbase_m = 0.25: measure it" in err
    assert "which would be 4444 by this value" in err
    assert "vesc_driver.port: the udev rules name the VESC" in err


def test_the_labs_file(tmp_path, capsys):
    _, out, err = imported(tmp_path, capsys, LAB)
    assert tomllib.loads(out)["wall_follow"] == {"side": "right", "speed_mps": 0.8, "desired_distance_m": 0.6}
    assert "wall_follower.kp: a gain of another law" in err


@pytest.mark.parametrize("joystick", [JOY_1, JOY_2])
def test_a_joysticks_scales_are_options_of_driving(joystick, tmp_path, capsys):
    code, out, err = imported(tmp_path, capsys, joystick)
    assert (code, out) == (0, "")
    assert "wallride teleop --max-speed 1.5" in err
    assert "wallride teleop --max-steering 0.3" in err


def test_a_negative_gain_is_a_motor_direction_and_turns_the_limits_round(tmp_path, capsys):
    text = "speed_to_erpm_gain: -4000.0\nspeed_min: -8000\nspeed_max: 16000\n"
    _, out, err = imported(tmp_path, capsys, text)
    told = tomllib.loads(out)
    assert told["motor"]["speed_to_erpm_gain"] == 4000.0
    assert told["car"] == {"max_speed_mps": 2.0}, "positive ERPM is backward there"
    assert "invert the motor direction in VESC Tool" in err
    assert "4.00 m/s backward" in err


def test_limits_of_other_nodes_are_in_other_units():
    found = list(
        parameters({"manager": {"ros__parameters": {"speed_max": 5.0}}, "/**": {"ros__parameters": {"kp": 1}}})
    )
    told = convert(found)
    assert told.settings == {}
    assert [name for name, _ in told.left] == ["manager.speed_max", "/**.kp"]


@pytest.mark.parametrize("value", [True, "fast", None, float("nan"), float("inf"), [1]])
def test_what_is_no_number_is_not_taken(value):
    for name in ("speed_to_erpm_gain", "wheelbase", "velocity", "speed_max", "servo_min", "side"):
        told = convert([RosParameter("", name, value)])
        assert told.settings == {}, name
        assert len(told.left) == 1


def test_a_later_file_counts_and_the_difference_is_said(tmp_path, capsys):
    _, out, err = imported(tmp_path, capsys, "wheelbase: 0.31\n", "wheelbase: 0.33\n")
    assert tomllib.loads(out)["car"]["wheelbase_m"] == 0.33
    assert "0.31 was given before" in err


def test_an_existing_file_keeps_its_comments(tmp_path, capsys):
    output = tmp_path / "car.toml"
    output.write_text('[car]\nname = "blue" # ours\nwheelbase_m = 0.3\n')
    code, _, _ = imported(tmp_path, capsys, "wheelbase: 0.33\n", options=["--output", str(output)])
    assert code == 0
    assert '"blue" # ours' in output.read_text()
    assert load_settings(output).car.wheelbase_m == 0.33


@pytest.mark.parametrize(
    ("text", "said"),
    [("servo_min: 0.6\n", "straight ahead"), ("a: [1\n", "is not YAML"), ("- 1\n", "holds no parameters"),
     ("wheelbase: 90\n", "car.wheelbase_m = 90")],
)  # fmt: skip
def test_an_unusable_file_changes_nothing_and_is_one_sentence(text, said, tmp_path, capsys):
    output = tmp_path / "car.toml"
    code, _, err = imported(tmp_path, capsys, text, options=["--output", str(output)])
    assert (code, said in err, output.exists()) == (2, True, False), err


def test_a_missing_file_and_no_file(tmp_path, capsys):
    assert main(["import", str(tmp_path / "none.yaml")]) == 2
    assert "none.yaml: No such file" in capsys.readouterr().err
    assert main(["import"]) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_car_is_complete_and_every_value_has_its_source(kind, tmp_path, capsys):
    output = tmp_path / "car.toml"
    assert main(["import", "--car", kind, "--output", str(output)]) == 0
    load_settings(output)
    lines = [line for line in shipped(f"config/cars/{kind}.toml").read_text().splitlines() if "=" in line]
    lines = [line for line in lines if not line.startswith(("#", "name"))]
    assert len(lines) >= 12
    assert [line for line in lines if "#" not in line] == []


def test_a_teams_file_on_top_of_a_kind(tmp_path, capsys):
    output = tmp_path / "car.toml"
    imported(tmp_path, capsys, ROS_1, options=["--car", "f1tenth", "--output", str(output)])
    told = load_settings(output)
    assert (told.motor.speed_to_erpm_gain, told.car.lidar_x_m) == (4200.0, 0.27)


def test_a_clamp_that_is_faster_than_the_cars_own_limit_is_said_and_not_taken(tmp_path, capsys):
    text = "speed_to_erpm_gain: 1466.0\nspeed_max: 23250\nspeed_min: -1000\n"
    code, told, said = imported(tmp_path, capsys, text)
    assert code == 0
    assert tomllib.loads(told)["car"] == {"max_reverse_mps": 0.682}
    assert "speed_max: 15.86 m/s is faster than the car's own limit, car.max_speed_mps = 4, which is kept" in said
    _, told, said = imported(tmp_path, capsys, text, options=("--car", "f1tenth"))
    assert tomllib.loads(told)["car"]["max_speed_mps"] == 5.04
    assert "car.max_speed_mps = 5.04, which is kept" in said


def test_a_file_as_editors_and_ros_leave_it_is_taken_and_a_second_key_is_said(tmp_path, capsys):
    text = "\ufeffspeed_to_erpm_gain: '4614.0'\t# stock\nservo_min: 0.15\nservo_min:\t0.2\n---\nservo_max: 0.8\n"
    code, told, said = imported(tmp_path, capsys, text)
    assert code == 0
    assert tomllib.loads(told)["motor"] == {"speed_to_erpm_gain": 4614.0, "servo_min": 0.2, "servo_max": 0.8}
    assert "line 3: servo_min is there a second time; this one counts" in said


@pytest.mark.parametrize(("text", "said"), [
    ("vesc:\n  speed_max: 'x\n", "line 3, vesc.speed_max: is not YAML"),
    ("a: " + "[" * 4000, "line 1, a: nests deeper"),
    ("a: &a [*a]\n", "refers to nothing"),
])  # fmt: skip
def test_a_file_that_is_none_or_has_no_end_is_one_sentence_with_its_line(text, said, tmp_path, capsys):
    code, _, spoken = imported(tmp_path, capsys, text)
    assert code == 2
    assert said in spoken
    assert "Traceback" not in spoken
