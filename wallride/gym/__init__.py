"""The simulator as a gymnasium environment: scan and odometry in, drive out.

import gymnasium
environment = gymnasium.make("wallride.gym:wallride/WallFollow-v0", world="track:seed=7")
"""

try:
    from gymnasium.envs.registration import register
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    message = "wallride.gym needs gymnasium: install it with  pip install 'wallride[gym]'"
    raise ModuleNotFoundError(message, name=error.name) from None

from wallride.gym.environment import WallFollowEnv

NAME = "wallride/WallFollow-v0"
register(id=NAME, entry_point="wallride.gym.environment:WallFollowEnv")

__all__ = ["NAME", "WallFollowEnv"]
