"""A gap follower: drives towards the direction in which the most is free."""

import numpy as np

from wallride.laws import CarSettings, Guidance, LawSettings, Scan, State


class GapSettings(LawSettings):
    """Settings; shown and changed as wall_follow.own.KEY."""

    reach_m: float = 3.0
    """Range above which all directions are equally free."""
    half_window_rad: float = 0.3
    """Half width of the window in which the nearest range counts: the car is wider than a beam."""
    turning_costs: float = 0.6
    """Range that a direction must be freer by for each radian away from ahead [m/rad]."""
    gain: float = 0.7
    """Steering per bearing of the best direction [-]."""


class GapFollower:
    """Steers for the freest direction within 80 degrees of ahead, slower the more it turns."""

    Settings = GapSettings

    def __init__(self, settings: GapSettings, car: CarSettings) -> None:
        self.settings = settings
        self.car = car

    def follow(self, scan: Scan, state: State) -> Guidance:
        """Answer one scan."""
        ahead = np.abs(scan.angles_rad) < np.radians(100)
        angles_rad = scan.angles_rad[ahead]
        # What is not seen is not free; what is far is all the same.
        ranges_m = np.clip(np.nan_to_num(scan.ranges_m[ahead], nan=0.0), 0.0, self.settings.reach_m)
        width = 2 * int(self.settings.half_window_rad / (angles_rad[1] - angles_rad[0])) + 1
        free_m = np.lib.stride_tricks.sliding_window_view(ranges_m, width).min(axis=1)
        middle_rad = angles_rad[width // 2 : width // 2 + free_m.size]
        best_rad = float(middle_rad[np.argmax(free_m - self.settings.turning_costs * np.abs(middle_rad))])
        speed_mps = state.desired_speed_mps * max(0.5, 1.0 - abs(best_rad))
        return Guidance(speed_mps, self.settings.gain * best_rad, reason="gap")
