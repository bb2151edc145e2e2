"""Drives in the simulator from Python, for notebooks and tests: `run(world, law)` returns what was driven, as arrays.

from wallride.lab import run
driven = run("loop", "my_laws:Follower", settings={"wall_follow.own.kp": 2.0}, duration_s=30)
plt.plot(driven.pose[:, 0], driven.pose[:, 1])
"""

from wallride.lab.drives import LawError, run

__all__ = ["LawError", "run"]
