"""`wallride` and `python -m wallride`: what the process needs before the command line's modules are imported."""

INTERRUPTED = 130


def start() -> int:
    """Run the command of this process; a Ctrl-C while its modules are imported ends it without a word, too."""
    try:
        from wallride.failure import ask_again_for_lost_interrupts, open_missing_streams

        open_missing_streams()
        ask_again_for_lost_interrupts()
        from wallride.cli import command

        return command()
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(start())
