"""Racing on a known map: the line that a car should drive, and how fast, computed before the drive."""
