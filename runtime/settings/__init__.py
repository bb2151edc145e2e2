"""The settings tree and its sections."""
