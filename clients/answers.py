"""What a car says, read by another computer's program: it may be of another version, faulty, or taken over."""

from collections.abc import Iterator
from contextlib import contextmanager

from wallride.clients.endpoints import ConnectionProblemError
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

ANSWER_WITHIN_S = 3.0


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


async def asked(bus: Bus, car: str, what: str, question: bytes = b"", timeout_s: float = ANSWER_WITHIN_S) -> bytes:
    """Return a car's answer to a request; RefusedError with its reason, ConnectionProblemError without an answer."""
    try:
        answers = await bus.ask(topics.key(car, what), question, timeout_s=timeout_s)
    except TimeoutError:
        answers = []
    if not answers:
        raise ConnectionProblemError(f"{car} does not answer {what}: {why_unanswered(by_keys=bus.is_by_keys)}")
    return answers[0]


def why_unanswered(*, by_keys: bool) -> str:
    """Return the question to a person whom a car does not answer. by_keys: whether certificates decide."""
    return "does your certificate allow it, and is the link up?" if by_keys else "does it still run? (wallride status)"
