"""Conditions and scenario files: what a drive is made of, read from TOML, and its run in virtual time."""
