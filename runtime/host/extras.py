"""How the packages of an extra are installed. wallride is on no index: its own name there would be another program."""


def how_to_install(extra: str) -> str:
    """Return the command, for sentences; also of an installation from a wheel."""
    return f"pip install '.[{extra}]' in the clone, or pip install 'FILE.whl[{extra}]' with the wheel's name"
