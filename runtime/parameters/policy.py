"""Three tables about settings: when a change takes effect, what is never saved from afar, and what loosens a limit.

Pure data, looked up by dotted name. A safety setting that is missing in the second table counts as loosened by any
change; a test holds the table complete, so that none can be forgotten.
"""

from collections.abc import Mapping
from enum import StrEnum

WALL_FOLLOW = "wall_follow."
SAFETY = "safety."


class Effect(StrEnum):
    """Time at which a new value takes effect."""

    NOW = "now"
    STANDING = "standing"
    """At once, but only while the car stands: the law itself is exchanged, and its learnt state is lost."""
    RESTART = "restart"


class Loosens(StrEnum):
    """Direction of a change that lets the car come nearer to harm."""

    UP = "up"
    DOWN = "down"
    TO_TRUE = "to true"
    TO_FALSE = "to false"
    ANY = "any change"
    """No direction is always the safe one, so none is treated as safe."""
    NEVER = "never"


_BUILT_ANEW = frozenset({"wall_follow.method", "safety.method"})
_NOW = frozenset({"car.max_speed_mps", "car.max_reverse_mps", "car.max_acceleration_mps2", "log.level"})
_NOW_SECTIONS = (WALL_FOLLOW, SAFETY, "telemetry.rates_hz.")

NEVER_FROM_AFAR: Mapping[str, str] = {
    "battery.": "describes the battery",
    "car.": "describes the car",
    "lidar.": "describes the lidar",
    "motor.": "describes the motor controller",
    "mux.": "says which source goes first",
    "operator.": "says what the car requires of its operators",
    "joystick.": "says who may drive",
    "telemetry.": "says who can reach the car",
    "planners.": "says who may drive",
    "ros2.": "says who can reach the car",
    "recording.folder": "names a folder of its computer",
    "recording.enabled": "decides what the black box keeps",
    "recording.ring_mb": "decides what the black box keeps",
    "recording.keep_free_mb": "decides what the black box keeps",
    "recording.black_box_s": "decides what the black box keeps",
    "recording.simulated": "says that the car is simulated",
    "recording.world": "says that the car is simulated",
    "map.": "names a map on its computer",
    "process.state_folder": "names a folder of its computer",
    "process.laws_folder": "names a folder of its computer",
    "parameters.history_file": "names a file of its computer",
}
"""Settings that only the file on the car sets, by the beginning of their names; those of them that are live may be set
and saved."""

LOOSENS: Mapping[str, Loosens] = {
    "car.max_speed_mps": Loosens.UP,
    "car.max_reverse_mps": Loosens.UP,
    "car.max_acceleration_mps2": Loosens.UP,
    # A longer validity of a command means longer driving on an old scan.
    "wall_follow.expires_after_s": Loosens.UP,
    "safety.expires_after_s": Loosens.UP,
    "safety.method": Loosens.ANY,
    "safety.binds_teleop": Loosens.TO_FALSE,
    "safety.odometry_check": Loosens.TO_FALSE,
    # Turning is not always safer: decision 6 has the figures.
    "safety.turn_below_m": Loosens.ANY,
    "safety.by_the_letter": Loosens.ANY,
    # More assumed grip is a shorter assumed stopping distance.
    "safety.grip_mu": Loosens.UP,
    "safety.slippery_mu": Loosens.UP,
    # Harder braking in a bend stops sooner and turns less.
    "safety.gentle_share": Loosens.ANY,
    "safety.hard_share": Loosens.UP,
    "safety.graded_share": Loosens.UP,
    # Stiffer tyres slip less: the arc moves sideways, towards one wall and away from the other.
    "safety.cornering_per_rad": Loosens.ANY,
    "safety.actuation_s": Loosens.DOWN,
    "safety.side_margin_m": Loosens.DOWN,
    "safety.wary_margin_m": Loosens.DOWN,
    "safety.front_margin_m": Loosens.DOWN,
    "safety.hold_s": Loosens.DOWN,
    "safety.release_m": Loosens.DOWN,
    "safety.creep_mps": Loosens.UP,
    # A lower value drives on where the car would have stopped, a higher one creeps where it would have gone more
    # slowly.
    "safety.slowest_mps": Loosens.ANY,
    "safety.reverse_mps": Loosens.UP,
    "safety.reverse_unseen_m": Loosens.UP,
    "safety.doubtful_mps": Loosens.UP,
    "safety.late_s": Loosens.UP,
    "safety.stale_s": Loosens.UP,
    # A car that backs out by itself moves where otherwise it would wait for help.
    "safety.backs_out": Loosens.TO_TRUE,
    "safety.recovery.boxed_for_s": Loosens.DOWN,
    "safety.recovery.tries": Loosens.UP,
    "safety.recovery.speed_mps": Loosens.UP,
    "safety.recovery.back_m": Loosens.UP,
    "safety.recovery.forward_m": Loosens.UP,
    "safety.recovery.forgotten_after_m": Loosens.DOWN,
    # A rule that classifies a beam as dirt both ignores it (looser) and lowers the ceiling (stricter).
    "safety.window.memory_m": Loosens.ANY,
    "safety.window.first_mask_m": Loosens.ANY,
    "safety.window.mask_above": Loosens.ANY,
    "safety.window.unmask_below": Loosens.ANY,
    "safety.window.masked_share": Loosens.UP,
    "safety.window.masked_gap_rad": Loosens.UP,
    "safety.window.refused_share": Loosens.UP,
    "safety.window.empty_share": Loosens.UP,
}
"""Every safety limit, and the few outside `safety` that bound the car under every source."""


def effect_of(name: str) -> Effect:
    """Return when a change of this setting takes effect; settings that are not live need a restart."""
    if name in _BUILT_ANEW:
        return Effect.STANDING
    if name in _NOW or name.startswith(_NOW_SECTIONS):
        return Effect.NOW
    return Effect.RESTART


def only_on_the_car(name: str) -> str:
    """Return why only the file on the car sets this setting, "" where an administrator may save it from afar."""
    if effect_of(name) is not Effect.RESTART:
        return ""
    return next((words for start, words in NEVER_FROM_AFAR.items() if name.startswith(start)), "")


def is_safety_relevant(name: str) -> bool:
    """Tell whether a setting bounds the car."""
    return loosens_by(name) is not Loosens.NEVER


def loosens_by(name: str) -> Loosens:
    """Return which direction of change loosens this setting."""
    return LOOSENS.get(name, Loosens.ANY if name.startswith(SAFETY) else Loosens.NEVER)


def is_looser(name: str, old: object, new: object) -> bool:
    """Tell whether going from old to new loosens a limit; values without an order, and added or removed keys, do."""
    rule = loosens_by(name)
    if rule is Loosens.NEVER or old == new:
        return False
    if rule in {Loosens.TO_TRUE, Loosens.TO_FALSE} and isinstance(old, bool) and isinstance(new, bool):
        return new is (rule is Loosens.TO_TRUE)
    if rule in {Loosens.UP, Loosens.DOWN} and isinstance(old, int | float) and isinstance(new, int | float):
        return new > old if rule is Loosens.UP else new < old
    return True
