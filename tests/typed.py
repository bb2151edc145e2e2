"""The options of a typed command, without a process."""

from wallride.cli import build_parser


def typed(*words):
    """Return the options of `wallride WORDS`."""
    return build_parser().parse_args([str(word) for word in words])


def telling(*words):
    """Return them, and the list that will hold what the command says."""
    options = typed(*words)
    options.print_line = (said := []).append
    return options, said
