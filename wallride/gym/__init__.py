"""The simulator as a gymnasium environment: scan and odometry in, drive out.

import gymnasium
environment = gymnasium.make("wallride.gym:wallride/WallFollow-v0", world="track:seed=7")
"""

from wallride.runtime.host.extras import how_to_install

try:
    from gymnasium.envs.registration import register
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    message = f"wallride.gym needs gymnasium: install it with {how_to_install('gym')}"
    raise ModuleNotFoundError(message, name=error.name) from None

from wallride.gym.environment import WallFollowEnv

NAME = "wallride/WallFollow-v0"
register(id=NAME, entry_point="wallride.gym.environment:WallFollowEnv")

__all__ = ["NAME", "WallFollowEnv"]
