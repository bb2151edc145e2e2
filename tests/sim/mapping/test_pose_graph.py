"""The pose graph on a square whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from wallride.sim.mapping.pose_graph import ERRORS, Edge, Origin, between, optimized, placed

SQUARE = [np.array([1.0, 0.0, 0.0])] * 4 + [np.array([1.0, 0.0, np.pi / 2])]


def way_round():
    """Return the true poses of a square of 5 m, and the shifts from each to the next."""
    shifts = SQUARE * 4
    poses = [np.zeros(3)]
    for shift in shifts:
        poses.append(placed(poses[-1], shift))
    return np.array(poses), shifts


def edges_of(shifts, error):
    std = np.array([0.02, 0.02, 0.02])
    return [
        Edge(number, number + 1, shift + error, np.diag(std**-2), Origin.ODOMETRY)
        for number, shift in enumerate(shifts)
    ]


def test_the_scale_of_the_wheels_is_found_where_matches_show_it_and_holds_where_they_do_not():
    true, shifts = way_round()
    by_errors = np.zeros((3, ERRORS))
    by_errors[0, 0] = 1.0
    edges = [replace(edge, by_errors=by_errors) for edge in edges_of(shifts, np.array([0.03, 0.0, 0.0]))]
    shown = [loop(number, number + 1, shifts[number]) for number in range(8)]
    poses, _, errors = optimized(drifted(edges), [*edges, *shown])
    assert errors[0] == pytest.approx(-0.03, abs=1e-3)
    assert np.hypot(*(poses - true)[:, :2].T).max() < 0.02


def loop(before, after, shift, std=0.002):
    return Edge(before, after, np.array(shift), np.eye(3) / std**2, Origin.LOOP)


def drifted(edges):
    poses = [np.zeros(3)]
    for edge in edges:
        poses.append(placed(poses[-1], edge.shift))
    return np.array(poses)


def test_a_loop_edge_takes_the_drift_out_of_the_ring():
    true, shifts = way_round()
    edges = edges_of(shifts, np.array([0.01, 0.0, 0.01]))
    start = drifted(edges)
    assert np.hypot(*(start - true)[-1, :2]) > 0.4
    poses, chi2, _ = optimized(start, [*edges, loop(0, 20, between(true[0], true[20]))])
    assert np.hypot(*(poses - true)[:, :2].T).max() < 0.15
    assert between(poses[0], poses[20]) == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)
    assert chi2.max() < 1.0


def test_one_false_edge_among_true_ones_is_left_out_and_told():
    true, shifts = way_round()
    edges = edges_of(shifts, np.array([0.002, 0.0, 0.002]))
    good = [loop(0, 20, between(true[0], true[20])), loop(1, 19, between(true[1], true[19]))]
    false = loop(0, 18, between(true[0], true[18]) + np.array([1.0, 0.0, 0.0]))
    poses, chi2, _ = optimized(drifted(edges), [*edges, *good, false])
    assert np.hypot(*(poses - true)[:, :2].T).max() < 0.05
    assert chi2[-1] > 1e3
