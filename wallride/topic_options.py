"""Options of `wallride topic`, `wallride cars` and `wallride status`."""

from wallride import client_options
from wallride.parser import Commands, at_least, number
from wallride.runtime.host.terminal_text import say


def add(commands: Commands) -> None:
    """Add the three commands."""
    topic = commands.add_parser("topic", help="topics of a car: list, hz, bw, echo")
    actions = topic.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="all topics with type, rate and volume")
    listing.add_argument(
        "--seconds", type=number(0.1, 600, "a number of seconds"), default=1.5, metavar="S",
        help="time to listen (default: 1.5)",
    )  # fmt: skip
    listing.add_argument("--json", action="store_true", help="print JSON")
    rate = actions.add_parser("hz", help="rate and jitter of a topic")
    volume = actions.add_parser("bw", help="bandwidth of a topic")
    echo = actions.add_parser("echo", help="print the messages of a topic")
    for action, what in ((rate, "lines, one a second"), (volume, "lines, one a second"), (echo, "messages")):
        action.add_argument("topic", metavar="TOPIC", help="scan, /scan or wallride/car1/scan")
        action.add_argument(
            "-n", "--count", type=at_least(0), default=0, metavar="N", help=f"stop after N {what} (default: never)"
        )
    for action in (rate, volume):
        action.add_argument("--json", action="store_true", help="print JSON, a line per second")
    echo.add_argument("--once", dest="count", action="store_const", const=1, help="the same as -n 1")
    echo.add_argument("--json", action="store_true", help="print JSON, a line per message")
    echo.add_argument("--whole", action="store_true", help="print arrays in full")
    for action in (listing, rate, volume, echo):
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("topics"), print_line=say)
    _add_status(commands)


def _add_status(commands: Commands) -> None:
    cars = commands.add_parser("cars", help="list cars with version and state; several endpoints: --connect A,B")
    status = commands.add_parser("status", help="state of a car and the reason why it moves or stands")
    status.add_argument("--watch", action="store_true", help="update until Ctrl-C")
    for command in (cars, status):
        client_options.add_common(command)
        command.add_argument("--json", action="store_true", help="print JSON")
    cars.add_argument("--watch", action="store_true", help="update until Ctrl-C; Space stops every car")
    client_options.add_name(cars)
    cars.set_defaults(run=client_options.client("fleet.cars"), print_line=say)
    status.set_defaults(run=client_options.client("status"), print_line=say)
