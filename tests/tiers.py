"""What `make test` leaves out (`pytest --quick`) and `make test-all` has: what is slow by nature.

Everything that stops the car is in both: laws, arbitration, drivers, the whole runtime in virtual time. Of a rule that
is tried in many worlds or with many lidars, `make test` tries some.
"""

from pathlib import Path
from typing import Final

import pytest
from hypothesis import settings

TESTS: Final = Path(__file__).resolve().parent
SLOW: Final = (
    # a browser
    "clients/monitor/test_browser", "sim/lab_report/test_browser.py", "system/test_watched",
    # processes in real time: the car with its emulated devices, ssh, benches
    "clients/remote/test_examples.py", "docs/test_five_steps.py", "sim/bench/test_measure.py",
    "sim/live/test_farewell.py", "system/faults/test_faults.py", "system/faults/test_router.py",
    "system/faults/test_swapped_ports.py", "docs/test_bring_up.py", "system/test_failing_scripts.py",
    "system/test_operator.py", "system/test_own_car.py", "system/test_race_begun.py",
    "system/test_own_driver.py", "system/test_own_law.py", "system/test_planners.py", "system/test_pwm_process.py",
    "system/test_poor_link.py", "system/test_process.py", "system/test_scenario.py", "system/test_sim_fleet.py",
    "system/test_ros2_receiver.py", "system/test_turning_lidars.py",
    "system/test_uplink.py", "system/test_walls.py", "system/test_ways_out.py", "wallride/deploy/test_over_ssh.py",
    "wallride/doctor/test_command.py", "wallride/doctor/test_planted_in_the_devices.py", "wallride/test_cli.py",
    "wallride/test_failure.py", "wallride/test_named_settings.py",
    "wallride/pulses/test_pulse_calibration.py",
    "wallride/test_install.py", "wallride/test_one_package.py", "wallride/vesc/test_command.py",
    # hundreds of drives or searches: the lab's experiments and what they are made of
    "benchmarks/test_corners.py", "benchmarks/test_recordings.py", "benchmarks/test_simulator.py",
    "runtime/calibration/test_planted_errors.py", "runtime/calibration/test_responses.py",
    "runtime/calibration/test_thin_drives.py", "sim/fit/test_fit.py", "sim/lab/", "sim/lab_report/test_report.py",
    "sim/replay/", "sim/scenario/test_virtual_drive.py", "sim/tuning/",
    "sim/virtual/test_turning_sensor.py", "sim/virtual/test_lidar_pose.py", "sim/test_generated.py", "wallride/gym/",
    "clients/calibration/test_steps.py", "clients/monitor/test_lap_watch.py", "sim/live/test_fleet.py",
    "sim/live/test_traffic.py", "sim/virtual/test_driving_together.py", "sim/world/test_map_file.py",
    "sim/world/test_map_start.py",
    # maps, poses and race lines of whole laps, computed off the car
    "sim/mapping/", "sim/races/", "sim/racing/", "wallride/test_line.py", "wallride/test_map.py",
    "wallride/test_pose.py",
    # what is looked at after a drive
    "sim/recordings/test_bombs.py", "sim/run_report/", "wallride/test_extras.py",
    # long recordings and full disks
    "runtime/recording/test_recorded_times.py", "runtime/recording/test_recorder_disk.py",
    "runtime/recording/test_recover.py", "runtime/recording/test_small_disk.py",
    "sim/figures/test_drawing.py",
)  # fmt: skip
"""Beginnings of paths below tests/."""


def pytest_addoption(parser):
    """Add --quick."""
    parser.addoption("--quick", action="store_true", help="leave out what is slow by nature, as `make test` does")


def pytest_ignore_collect(collection_path, config):
    """Leave out what is slow, where that is asked for."""
    name = collection_path.relative_to(TESTS).as_posix() if collection_path.is_relative_to(TESTS) else ""
    name += "/" * collection_path.is_dir()
    return True if config.getoption("--quick") and name.startswith(SLOW) else None


def slow(*values):
    """Return these values of a parameter, tuples of several, with the mark of what --quick leaves out."""
    rows = (value if isinstance(value, tuple) else (value,) for value in values)
    return [pytest.param(*row, marks=pytest.mark.slow) for row in rows]


def pytest_sessionstart(session):
    """Let Hypothesis try fewer examples under --quick, where a test does not say how many."""
    if session.config.getoption("--quick"):
        settings.register_profile("quick", settings.get_profile("untimed"), max_examples=25)
        settings.load_profile("quick")


def without_slow(items, config):
    """Return the tests that this run has, of all that were collected."""
    if not config.getoption("--quick"):
        return items
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("slow")])
    return [item for item in items if not item.get_closest_marker("slow")]
