"""The response fit finds a delay without a bias of its own: planted in continuous time, off the fit's grid."""

import numpy as np
import pytest

from wallride.runtime.calibration.responses import CommandSteps, Samples, fit_response
from wallride.runtime.control.perception.geometry import Floats

FINE_S = 1e-4
RATE_RADPS = 3.2
DELAYS_S = [0.0025 * k for k in range(60)]


def drive(delay_s, seed):
    """Return steps at any moment, and the means over 50 ms of their response at a rate, computed in steps of 0.1 ms."""
    rng = np.random.default_rng(seed)
    at_s: Floats = np.cumsum(rng.uniform(0.3, 0.7, 30)).astype(np.float64)
    command = CommandSteps(at_s, np.resize(np.array([0.2, -0.2]), 30))
    times_s = np.arange(0.0, at_s[-1], FINE_S)
    wanted_rad = command.at(times_s - delay_s)
    angle_rad, now_rad = np.empty(times_s.size), wanted_rad[0]
    for k, wanted in enumerate(wanted_rad):
        now_rad += np.clip(wanted - now_rad, -RATE_RADPS * FINE_S, RATE_RADPS * FINE_S)
        angle_rad[k] = now_rad
    total = np.concatenate([[0.0], np.cumsum(angle_rad) * FINE_S])
    edges_s = np.arange(at_s[0], times_s[-1], 0.05)
    whole = np.interp(edges_s, np.append(times_s, times_s[-1] + FINE_S), total)
    means_rad = np.diff(whole) / np.diff(edges_s)
    return command, Samples(edges_s[:-1], edges_s[1:], means_rad, np.ones(means_rad.size))


@pytest.mark.parametrize("delay_s", [0.0413, 0.1])
def test_the_delay_is_found_between_the_grid_s_steps_and_without_bias(delay_s):
    found_s = []
    for seed in range(2):
        command, samples = drive(delay_s, seed)
        fit = fit_response(command, samples, DELAYS_S, [RATE_RADPS])
        assert fit is not None
        found_s.append(fit.delay_s.value)
    assert np.abs(np.array(found_s) - delay_s).max() <= 6e-4
