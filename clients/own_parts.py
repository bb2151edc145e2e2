"""`wallride own-parts`: parts of the car in its lidar's view, and the command to learn them anew."""

import argparse
import json
from contextlib import AsyncExitStack

from wallride.clients.answers import reading, why_unanswered
from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.status import own_parts_words
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError

ANSWER_WITHIN_S = 2.0
WITHOUT_A_CAR = (
    "Without a running car: they are kept in own-parts.json in process.state_folder (the service's: /var/lib/wallride);"
    " delete the file to have them learnt again"
)


async def run(options: argparse.Namespace) -> int:
    """Run one `wallride own-parts` command; an error is one line."""
    async with AsyncExitStack() as stack:
        try:
            bus, car = await stack.enter_async_context(connected(options, asks=True))
        except ConnectionProblemError as error:
            raise ConnectionProblemError(f"{error}. {WITHOUT_A_CAR}") from None
        try:
            answers = await bus.ask(topics.key(car, f"{topics.OWN_PARTS}/{options.action}"), timeout_s=ANSWER_WITHIN_S)
        except RefusedError as error:
            raise ConnectionProblemError(str(error)) from None
        except TimeoutError:
            answers = []
    if not answers:
        raise ConnectionProblemError(f"{car} does not say: {why_unanswered(by_keys=bus.is_by_keys)}")
    with reading(car, "answer"):
        told = topics.decode(answers[0])
        say(json.dumps(told) if options.json else one_line(own_parts_words(told)))
    return 0
