"""The computer around the process: systemd, logging, scheduling."""
