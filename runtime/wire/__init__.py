"""What crosses the network: topics, the teleop protocol, the zenoh session and its configuration."""
