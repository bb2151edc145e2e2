"""Network interface: topics, the teleop protocol, the zenoh session and its configuration."""
