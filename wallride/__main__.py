"""`python -m wallride`."""

from wallride.cli import command

raise SystemExit(command())
