"""`wallride calibrate`: drives short ways, and proposes settings from what it saw. Read `ways`, `link`, `steps`."""

SPEED, STEERING, LIDAR, PARTS, DELAY, BRAKE, OUTLINE = STEPS = (
    "speed", "steering", "lidar", "own-parts", "delay", "brake", "outline",
)  # fmt: skip
