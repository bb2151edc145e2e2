"""The follower `ball`: the followed wall, the ball's path, steering and speed."""
