"""`wallride own-parts`: parts of the car in its lidar's view, and the command to learn them anew."""

import argparse
import json
from contextlib import AsyncExitStack

from wallride.clients.answers import asked, reading
from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.status import own_parts_words
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError

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
            answer = await asked(bus, car, f"{topics.OWN_PARTS}/{options.action}")
        except RefusedError as error:
            raise ConnectionProblemError(str(error)) from None
    with reading(car, "answer"):
        told = topics.decode(answer)
        say(json.dumps(told) if options.json else one_line(own_parts_words(told)))
    return 0
