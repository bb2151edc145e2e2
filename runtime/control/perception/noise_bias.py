"""How much too near the nearest of many noisy points is: b = d_line - d_nearest, slowly averaged [m]."""

LOWEST_M, HIGHEST_M = -0.02, 0.12
LOW_PASS = 0.1


def bias_learnt_m(bias_m: float, line_m: float, nearest_m: float) -> float:
    """Return the bias after one more scan. line_m: NaN while the wall is no clean line: then the bias is held."""
    found_m = line_m - nearest_m
    return bias_m + LOW_PASS * (found_m - bias_m) if LOWEST_M < found_m < HIGHEST_M else bias_m
