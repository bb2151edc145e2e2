"""A law is entered in two lists; the failure names the list that lacks it, and what its settings lack."""

import pytest

from wallride.runtime.control.laws import FOLLOWERS, SAFETY
from wallride.runtime.control.method_settings import METHODS, OWN_METHODS, name_of

ROWS = {"wall_follow": ("FOLLOWERS", FOLLOWERS), "safety": ("SAFETY", SAFETY)}
UNIONS = {"wall_follow": "WallFollowSettings", "safety": "SafetySettings"}
NEEDED = {
    "wall_follow": {"side", "desired_distance_m", "speed_mps", "expires_after_s"},
    "safety": {"binds_teleop", "odometry_check", "expires_after_s"},
}


@pytest.mark.parametrize("section", METHODS)
def test_every_law_with_settings_can_be_made_and_every_other_way_round(section):
    table, rows = ROWS[section]
    named = {name_of(law) for law in (*METHODS[section], OWN_METHODS[section])}
    assert not named - rows.keys(), f"add {sorted(named - rows.keys())} to {table} in runtime/control/laws.py"
    unknown = sorted(rows.keys() - named)
    assert not unknown, f"add the settings of {unknown} to {UNIONS[section]} in runtime/control/method_settings.py"


@pytest.mark.parametrize(("section", "law"), [(section, law) for section in METHODS for law in METHODS[section]])
def test_the_settings_of_every_law_have_what_the_car_reads(section, law):
    lacking = sorted(NEEDED[section] - law.model_fields.keys())
    assert not lacking, f"add {lacking} to {law.__name__} in {law.__module__}"
    assert law().method == name_of(law)
