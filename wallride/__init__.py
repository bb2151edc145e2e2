"""The front door: the `wallride` command. Everything else is imported when it is needed, never before."""
