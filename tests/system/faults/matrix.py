"""The fault matrix: every fault, the promised reaction, its bound, and the test that holds it.

A row without a bound promises words or a recovery, not a brake in a time. `test` is a test's file and name, or the name
of an injected fault (`injected.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

SOFT_S: Final = 0.25
"""Bound of everything that ends good data, from the last good scan or from the fault to the brake on the wire."""
HARD_S: Final = 0.5
"""Bound where only the motor controller's own timeout or the watchdog is left."""
GAP_S: Final = 0.15
"""Bound of the time without a motor command where the car drives on: the motor controller's timeout."""
BATTERY_S: Final = 1.5
INJECTED: Final = "injected"


@dataclass(frozen=True)
class Fault:
    """One row. afterwards: when the car moves again."""

    group: str
    name: str
    promise: str
    afterwards: str
    test: str
    bound_s: float | None = None

    @property
    def key(self) -> str:
        """Return the name under which it is injected and measured."""
        return f"{self.group.split()[0].lower()} {self.name}"


SELF: Final = "by itself with good data; by hand or with a permit required: release, press again"
PERMIT: Final = "permit again"
RESET: Final = 'remedy, reset, permit again (permit "always" retries by itself)'
BY_HAND: Final = "remedy, reset, permit again"
LIDAR: Final = "Lidar"
MOTOR: Final = "Motor controller"
POWER: Final = "Power and computer"
PROCESS: Final = "Process"
OPERATOR: Final = "Operator"
PERSON: Final = "Seen by a person only"
HOKUYO_LOSSES: Final = "tests/drivers/hokuyo/test_driver_losses.py::"
HOKUYO_SENSORS: Final = "tests/drivers/hokuyo/test_driver_sensors.py::"
VESC: Final = "tests/drivers/vesc/test_driver.py::"
VESC_LOSSES: Final = "tests/drivers/vesc/test_driver_losses.py::"
DESK: Final = "tests/runtime/teleop/test_desk.py::"
DESK_AGE: Final = "tests/runtime/teleop/test_desk_age.py::"
DESK_LOSSES: Final = "tests/runtime/teleop/test_desk_losses.py::"
PILOT: Final = "tests/clients/teleop/test_pilot.py::"
SYSTEM: Final = "tests/system/test_process.py::"
LATE_LINK: Final = "tests/system/test_late_link.py::"
STORIES: Final = "tests/system/test_stories.py::"
OWN_LAW: Final = "tests/system/test_own_law.py::"

MATRIX: Final[Sequence[Fault]] = (
    Fault(LIDAR, "unplugged", "brake; reconnect for ever", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "silent", "brake; restart the stream, then the connection", SELF,
          SYSTEM + "test_a_silent_lidar_brakes_and_a_talking_one_drives_on", SOFT_S),
    Fault(LIDAR, "garbage", "no wrong distance; brake; resync", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "bad checksums", "the scan is lost, counted; brake when all are", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "single bad scans", "drives on, counted", "never stops",
          SYSTEM + "test_noise_and_bad_checksums_cost_scans_not_the_drive"),
    Fault(LIDAR, "dribbling", "drives on", "never stops",
          SYSTEM + "test_a_lidar_that_dribbles_byte_by_byte_drives_the_car_all_the_same"),
    Fault(LIDAR, "late burst", "nothing stale drives", SELF,
          SYSTEM + "test_a_burst_after_a_stall_drives_by_nothing_stale", SOFT_S),
    Fault(LIDAR, "late from the first byte", "its scans' age is known by the sensor's clock or its quickest"
          " answer: it does not move, said", SELF,
          LATE_LINK + "test_a_lidar_that_is_late_from_the_first_byte_never_moves_the_car"),
    Fault(LIDAR, "becomes late", "brake; it stays standing while the link is late, said", SELF,
          LATE_LINK + "test_a_lidar_that_becomes_late_stops_the_car_before_the_wall_and_for_good"),
    Fault(LIDAR, "does not tell its time (TM)", "drives on; age by its quickest answer, said", "-",
          "tests/drivers/hokuyo/test_late_link.py::"
          "test_a_sensor_that_does_not_tell_its_time_is_driven_by_all_the_same"),
    Fault(LIDAR, "does not tell version or state (VV, II)", "drives on, said", "-",
          HOKUYO_SENSORS + "test_a_sensor_that_does_not_tell_what_is_for_people_is_driven_by_and_said"),
    Fault(LIDAR, "frozen", "named, brake", SELF, INJECTED, HARD_S),
    Fault(LIDAR, "clock jumps ahead", "brake until the new clock is believed", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "clock jumps back", "brake until the new clock is believed", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "covered", "no echo anywhere is not free: brake", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "hand before it", "brake", SELF, INJECTED, SOFT_S),
    Fault(LIDAR, "dirty window", "slower, beams named", "a clean window",
          STORIES + "test_a_dirty_window_is_said_and_a_clean_one_is_not"),
    Fault(LIDAR, "error codes as ranges", "only DMIN..DMAX are distances", "-",
          "tests/drivers/hokuyo/test_codec.py::test_a_million_mutated_bytes_never_give_a_distance_that_the_sums_do_not_cover"),
    Fault(LIDAR, "in trouble", "RS, then RB once in 20 s, then a human is called", SELF,
          HOKUYO_SENSORS + "test_a_sensor_that_nothing_cures_is_rebooted_once_in_20_s_and_a_human_is_called"),
    Fault(LIDAR, "unstable, blinded by the sun", "keeps the stream, named", SELF,
          HOKUYO_SENSORS + "test_an_unstable_sensor_keeps_its_stream_and_says_so"),
    Fault(LIDAR, "abnormal words", "every healthy wording of every model is accepted", "-",
          "tests/drivers/hokuyo/test_codec.py::test_the_three_ways_to_say_fine"),
    Fault(LIDAR, "left streaming, SCIP 1.1, time sync", "taken over", "-",
          HOKUYO_LOSSES + "test_a_sensor_in_the_wrong_mode_is_brought_back"),
    Fault(LIDAR, "other baud rate", "searched", "-",
          HOKUYO_LOSSES + "test_the_speed_of_a_serial_sensor_is_found"),
    Fault(LIDAR, "refuses the connection", "tried for ever, another client suggested", SELF,
          HOKUYO_LOSSES + "test_a_refused_connection_is_tried_until_it_succeeds"),
    Fault(LIDAR, "another one, another angle order", "its own parameters are asked for; permit is taken back", PERMIT,
          "tests/runtime/tasks/test_health.py::"
          "test_another_lidar_than_before_takes_the_permit_back_even_if_it_was_exchanged_in_a_blink"),
    Fault(LIDAR, "shows old scans, or a blank where walls were", "named, brake within half a metre", PERMIT,
          "tests/system/test_untrue_scans.py::"
          "test_a_lidar_that_stops_telling_the_truth_is_named_and_the_car_stands_within_half_a_metre"),
    Fault(LIDAR, "slow lidar shows its last turn again, with noise",
          "named, brake within a metre; later where nearly all walls are parallel", PERMIT,
          "tests/system/test_untrue_scans.py::"
          "test_a_slow_lidar_that_shows_its_last_turn_again_with_a_noise_of_its_own_stops_the_car"),
    Fault(LIDAR, "turned on the car, or lidar.yaw_rad wrong, by 40 degrees or more",
          "named, stands within half a metre; a metre where all walls are parallel",
          "remedy, power-cycle the lidar or start again", "tests/system/test_untrue_scans.py::"
          "test_a_lidar_turned_on_the_car_or_in_the_settings_stops_it_for_good_before_a_contact"),
    Fault(LIDAR, "too few beams, too slow", "refused with the reason", "another sensor",
          HOKUYO_SENSORS + "test_a_sensor_that_no_car_can_be_driven_by_is_refused_with_the_reason"),
    Fault(MOTOR, "unplugged, back at speed", "no command is kept; it starts from standstill", SELF,
          SYSTEM + "test_an_unplugged_vesc_is_waited_for_and_met_gently"),
    Fault(MOTOR, "reboots", "its own loss of power lets go; no speed is kept", SELF, INJECTED, HARD_S),
    Fault(MOTOR, "mute", "a brake as the last word, reopen", SELF, INJECTED, SOFT_S),
    Fault(MOTOR, "deaf", "its own timeout brakes", SELF, INJECTED, HARD_S),
    Fault(MOTOR, "bad checksums", "never believed; a brake, reopen", SELF, INJECTED, SOFT_S),
    Fault(MOTOR, "garbage", "never believed; a brake, reopen", SELF, INJECTED, SOFT_S),
    Fault(MOTOR, "noise, slow replies", "counted, drives on", "never stops",
          VESC_LOSSES + "test_it_lives_with_noise_and_dribble"),
    Fault(MOTOR, "fault", "latched, brake, words with the remedy", RESET, INJECTED, SOFT_S),
    Fault(MOTOR, "kill switch", "brake while it is on", SELF, INJECTED, SOFT_S),
    Fault(MOTOR, "impossible speed", "brake, never believed", SELF, INJECTED, SOFT_S),
    Fault(MOTOR, "turns the wrong way", "latched once after half a metre, names the phases", BY_HAND,
          "tests/system/test_plausibility.py::"
          "test_a_car_with_two_phases_swapped_stands_after_half_a_metre_and_says_what_to_do"),
    Fault(MOTOR, "counter contradicts speed", "latched", BY_HAND,
          "tests/system/test_plausibility.py::test_a_controller_that_contradicts_itself_is_held_with_the_remedy_in_the_log"),
    Fault(MOTOR, "other firmware", "read first, decoded by its layout, named", "-",
          VESC + "test_every_firmware_is_identified_and_understood"),
    Fault(MOTOR, "battery manager on the port", "refused, named", "the right port",
          VESC + "test_a_battery_manager_on_the_port_is_refused"),
    Fault(MOTOR, "lidar on its port", "asked only who it is; refused, named", "the right port",
          VESC + "test_a_talker_that_is_no_vesc_is_refused_and_named_so"),
    Fault(MOTOR, "silent port", "named within 5 s, tried for ever", SELF,
          VESC + "test_a_silent_port_is_named_so_and_tried_again"),
    Fault(MOTOR, "second program on the port", "refused: the port is held exclusively", "end the other program",
          "tests/drivers/test_link.py::test_a_second_user_of_a_port_is_told_that_it_is_held"),
    Fault(MOTOR, "commands only on change", "sent again at every tick", "-", STORIES + "test_it_ticks_on_in_silence"),
    Fault(MOTOR, "PWM board lost or reset", "named within 0.5 s; brake, then neutral when it is back; a PCA9685"
          " without its bus goes on with its last pulse", "by itself after neutral with a permit",
          "tests/system/test_pwm_car.py::test_a_lost_board_stops_the_car_with_its_reason_and_it_comes_back"),
    Fault(MOTOR, "PWM car whose scans tell no speed", "slower, said", "by itself",
          "tests/system/test_pwm_car.py::test_between_bare_walls_it_is_slow_and_says_so"),
    Fault(MOTOR, "PWM car that stands, runs away or backward when driven", "brake; a fault with its remedy", BY_HAND,
          "tests/system/test_pwm_car.py::test_an_esc_that_is_off_is_a_fault_with_its_remedy"),
    Fault(MOTOR, "Maestro that nothing commands", "its own serial timeout", "-",
          "tests/drivers/maestro/test_maestro.py::test_its_timeout_is_found_and_stops_a_car_that_nothing_commands"),
    Fault(POWER, "low battery", "at most 1 m/s, said", "by itself at 3.5 V per cell for 2 s", INJECTED, BATTERY_S),
    Fault(POWER, "empty battery", "brake with its own words", "another battery for 2 s, permit again", INJECTED,
          BATTERY_S),
    Fault(POWER, "absent battery", "brake, \"no battery\"", "plug it in, permit again", INJECTED, BATTERY_S),
    Fault(POWER, "voltage unstable at the start", "2 s of good voltage before any motion", "2 s of good voltage",
          "tests/runtime/control/test_battery.py::test_nothing_moves_before_two_seconds_of_good_voltage"),
    Fault(POWER, "throttled computer, over-current", "said with the remedy", "-",
          "tests/runtime/host/test_computer.py::"
          "test_a_jetsons_over_current_events_are_said_when_they_come_not_when_they_came"),
    Fault(POWER, "hot computer", "said with the remedy", "-",
          "tests/runtime/host/test_computer.py::test_the_hottest_zone_counts_and_dead_sensors_do_not"),
    Fault(POWER, "busy processors", "brake for a wall as on a quiet one", SELF, INJECTED, SOFT_S),
    Fault(PROCESS, "safety task silent", "no autonomous motion, at the follower's next scan", "safety's next limit",
          "tests/runtime/arbitration/test_command.py::test_decision"),
    Fault(PROCESS, "both devices silent", "brake", SELF, INJECTED, SOFT_S),
    Fault(PROCESS, "both devices unplugged", "the controller's timeout brakes; reconnect", SELF, INJECTED, HARD_S),
    Fault(PROCESS, "stopped 50 ms", "drives on", "never stops", INJECTED, GAP_S),
    Fault(PROCESS, "stopped 200 ms", "the controller's timeout brakes", SELF, INJECTED, HARD_S),
    Fault(PROCESS, "stopped 1 s", "the controller's timeout brakes; nothing stale drives", SELF, INJECTED, HARD_S),
    Fault(PROCESS, "task raises", "brake, the process ends", "restart by systemd, permit again",
          STORIES + "test_a_task_that_dies_takes_the_car_to_a_stop", SOFT_S),
    Fault(PROCESS, "loop broken", "one last brake without the loop", "restart by systemd, permit again",
          "tests/runtime/test_launch.py::test_a_loop_that_breaks_is_followed_by_a_brake"),
    Fault(PROCESS, "task cancelled", "brake, the process ends", "restart by systemd, permit again",
          OWN_LAW + "test_a_law_that_cancels_the_task_it_runs_in_ends_the_drive_with_a_sentence"),
    Fault(PROCESS, "own law raises or answers oddly", "brake; its fault, with file and line", PERMIT,
          "tests/runtime/control/own_laws/test_own_laws.py::"
          "test_each_mistake_stops_the_car_with_name_and_line"),
    Fault(PROCESS, "own driver raises, hangs, lies", "brake; its fault, with file and line; it is made anew", SELF,
          "tests/system/test_own_driver.py::"
          "test_a_lie_stops_the_car_with_its_reason_and_line_and_the_process_lives"),
    Fault(PROCESS, "own law or driver takes a signal or the exit",
          "brake; its fault; SIGTERM ends the process. Where only C shows it, no fault: the signal is put right within"
          " 1 s", PERMIT,
          OWN_LAW + "test_a_law_takes_neither_the_signals_nor_the_exit"),
    Fault(PROCESS, "SIGTERM", "brake, rest, exit code 0", "start it again",
          SYSTEM + "test_sigterm_at_full_speed_brakes_at_once_and_exits_with_0", SOFT_S),
    Fault(PROCESS, "SIGKILL", "the controller's timeout brakes", "restart by systemd, permit again",
          SYSTEM + "test_after_kill_9_the_vescs_own_timeout_stops_the_car", HARD_S),
    Fault(PROCESS, "no descriptors left", "brake; the devices' own are kept back", SELF, INJECTED, SOFT_S),
    Fault(PROCESS, "no descriptors left for connections", "drives on; counted (`computer.refusing`), said", "-",
          "tests/runtime/host/test_computer.py::"
          "test_used_up_descriptors_are_counted_and_named_when_they_begin"),
    Fault(PROCESS, "no memory left", "brake; connects again once there is memory", SELF, INJECTED, SOFT_S),
    Fault(PROCESS, "clock jumps a day", "drives on by the monotonic clock; stamps follow", "never stops", INJECTED,
          GAP_S),
    Fault(PROCESS, "clock before 2024 or after 2038", "said; stamps end with ROS 2's; no session after 2106",
          "set the clock", "tests/runtime/ros/test_messages.py::"
          "test_a_stamp_beyond_ros_2s_32_bits_is_their_last"),
    Fault(PROCESS, "no memory for what decides or drives", "brake; ends with a sentence, closes its recording",
          "restart by systemd", "tests/runtime/test_launch.py::test_a_drive_without_memory_ends_with_a_sentence"),
    Fault(PROCESS, "no memory for what learns", "the same, before numpy crashes", "restart by systemd",
          "tests/runtime/test_launch.py::"
          "test_learning_without_memory_ends_the_drive_before_the_interpreter_crashes"),
    Fault(PROCESS, "no memory for a thread", "brake; ends in time by the kernel's timer", "restart by systemd",
          "tests/runtime/test_launch.py::test_a_process_whose_end_hangs_is_ended"),
    Fault(PROCESS, "disk full", "drives and brakes on; the recording says so", SELF, INJECTED, SOFT_S),
    Fault(PROCESS, "stuck disk", "holds nothing up, said", "-",
          "tests/runtime/recording/test_recorder_disk.py::test_a_stuck_disk_holds_nobody_up_and_is_said"),
    Fault(PROCESS, "recordings not deletable", "skipped and named once; the next one goes", "-",
          "tests/runtime/recording/test_ring.py::"
          "test_an_odd_entry_is_skipped_and_named_once_and_the_next_one_goes"),
    Fault(PROCESS, "open recording deleted or cut", "another file begins with the last half minute", "-",
          "tests/runtime/recording/test_recorder_disk.py::"
          "test_an_open_recording_and_black_box_that_another_program_takes_begin_anew"),
    Fault(PROCESS, "log not read", "drives on, ends in time; lines are dropped", "-",
          "tests/runtime/host/test_logging_setup.py::"
          "test_a_terminal_that_reads_nothing_holds_up_neither_the_process_nor_its_end"),
    Fault(PROCESS, "network port taken", "the start ends with the owner's name", "end the other car",
          "tests/system/test_own_car.py::test_a_port_of_another_program_is_refused_too"),
    Fault(PROCESS, "ports swapped", "stands; says of both devices that they are others", "the right ports",
          "tests/system/faults/test_swapped_ports.py::test_devices_on_each_others_ports_are_named_and_nothing_moves"),
    Fault(PROCESS, "zenoh router dies", "brake; the one that comes back moves nothing", "release, press again",
          "tests/system/faults/test_router.py::"
          "test_a_router_that_dies_stops_the_car_and_one_that_comes_back_moves_nothing", SOFT_S),
    Fault(PROCESS, "client does not read", "its answers are dropped; nothing waits for it", "-",
          "tests/runtime/wire/test_car_bus.py::test_a_client_that_asks_and_does_not_read_holds_up_nothing"),
    Fault(PROCESS, "flood of messages", "the loop keeps its turns", "-",
          "tests/runtime/wire/test_bus.py::test_a_flood_leaves_the_loop_its_turns"),
    Fault(PROCESS, "stale settings", "`wallride check` prints those in effect; a wrong one is refused", "-",
          "tests/drivers/vesc/test_settings.py::test_bad_settings_are_refused_with_a_reason"),
    Fault(OPERATOR, "radio lost, laptop gone", "brake; the place is kept free of others", "release, press again",
          "tests/system/test_operator.py::test_a_lost_operator_stops_the_car_and_nobody_else_goes_on", SOFT_S),
    Fault(OPERATOR, "release lost on the way", "the level counts, sent every cycle", "-",
          PILOT + "test_deadman_then_stick_drives_and_release_is_sent_every_cycle"),
    Fault(OPERATOR, "late burst of commands", "none is obeyed", "release, press again",
          DESK_AGE + "test_a_burst_of_late_commands_moves_nothing"),
    Fault(OPERATOR, "copies of commands", "not obeyed", "-",
          DESK_AGE + "test_a_copy_of_a_fresh_command_is_not_obeyed"),
    Fault(OPERATOR, "frozen pad", "stop after 1 s without an event", "release, press again",
          DESK_LOSSES + "test_a_pad_that_drives_without_an_event_is_frozen"),
    Fault(OPERATOR, "pad lost", "is no release: stop", "release, press again",
          DESK_LOSSES + "test_a_pad_that_is_gone_is_no_release"),
    Fault(OPERATOR, "unknown pad, switched axes", "refused; identified by USB id", "map it",
          "tests/clients/teleop/test_pads.py::test_a_pad_that_nobody_knows_is_refused_with_the_way_out"),
    Fault(OPERATOR, "stick not centred", "does not count until released", "release",
          PILOT + "test_a_deadman_pressed_with_a_stick_out_of_its_middle_does_not_count_until_released"),
    Fault(OPERATOR, "idle stick", "an idle client blocks nothing", "-",
          DESK + "test_with_permit_always_an_explicit_release_lets_autonomy_go_on"),
    Fault(OPERATOR, "autonomy without effect", "status names the source that decides and why", "-",
          "tests/clients/test_status.py::test_one_screen_holds_everything_that_may_hold_the_car"),
    Fault(POWER, "a mistake in telemetry, recording or learning", "counted, named in the status, tried again",
          "never stops",
          "tests/system/test_side_work.py::test_a_mistake_beside_the_way_does_not_end_the_drive_and_is_named"),
    Fault(OPERATOR, "status, page or recording while it drives", "asking changes no decision", "never stops",
          "tests/system/test_hand_overs.py::test_a_status_changes_no_decision_of_a_hand_over"),
)  # fmt: skip

BY_PERSON: Final[Sequence[tuple[str, str]]] = (
    ("servo output disabled in the VESC", "no read-back exists: steer it, wheels up: docs/bring-up.md, Steering"),
    ("steering the wrong way round", "steer it, wheels up: docs/bring-up.md, Steering"),
    ("the sensor's address was changed, to no effect", "it counts after a power cycle; wallride changes none"),
    ("two sensors with one address", "wallride drives with one; give the other another address first"),
    ("lidar and Wi-Fi exclude each other", "an address in its subnet without a gateway: docs/bring-up.md"),
    ("a power bank switches off at low load", "use one without a cut-off, or a converter on the car's battery"),
)  # fmt: skip
"""Faults that software on the car cannot tell: fault, what to do."""
