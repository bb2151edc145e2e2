"""What a car says, read by another computer's program: it may be of another version, faulty, or taken over."""

from collections.abc import Iterator
from contextlib import contextmanager

from wallride.clients.endpoints import ConnectionProblemError
from wallride.runtime.host.terminal_text import one_line


@contextmanager
def reading(car: str, what: str) -> Iterator[None]:
    """Read a car's words inside the block: what cannot be read becomes a ConnectionProblemError that names the car."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise ConnectionProblemError(
            f"{one_line(car, 64)}: its {what} cannot be read ({type(error).__name__}): is another version of wallride"
            " on it? (wallride --version on both)"
        ) from error


def why_unanswered(*, by_keys: bool) -> str:
    """Return the question to a person whom a car does not answer. by_keys: whether certificates decide."""
    return "does your certificate allow it, and is the link up?" if by_keys else "does it still run? (wallride status)"
