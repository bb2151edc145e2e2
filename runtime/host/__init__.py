"""The computer around the process: systemd, logging."""
