"""Which port a simulated car has, and what is said when another program has the wanted one."""

import argparse
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from wallride.runtime.host.address_file import Address
from wallride.runtime.settings.tree import Settings
from wallride.sim.live import command, fleet
from wallride.sim.live.record import Record
from wallride.sim.live.screen import port_notice
from wallride.sim.live.terminal_view import ViewStatus, status_rows

STANDARD = ("tcp/127.0.0.1:7447",)
ELSEWHERE = "tcp/127.0.0.1:40123"
SAID = f"port 7447 is taken by another car or program; this one is at {ELSEWHERE}"


def at(endpoint):
    return Address("sim", "0000cafe", endpoint)


def test_a_car_that_did_not_get_its_port_says_so():
    assert port_notice(at(ELSEWHERE), STANDARD).startswith(SAID)


@pytest.mark.parametrize(
    ("address", "listen"),
    [(None, STANDARD), (at(""), STANDARD), (at(STANDARD[0]), STANDARD), (at(ELSEWHERE), (ELSEWHERE,)), (at("x"), ())],
)
def test_a_car_at_its_port_or_without_a_wanted_one_says_nothing(address, listen):
    assert port_notice(address, listen) == ""


def test_it_is_said_once_without_a_live_view_and_is_a_row_of_it():
    console = Console(record=True, width=300)
    tell = command._teller(console)
    for _ in range(3):
        tell(Record(address=at(ELSEWHERE), listen=STANDARD))
    assert console.export_text().count(SAID) == 1
    assert ("port", SAID) in status_rows(ViewStatus(0.0, None, None, None, "", "", "", "", port=SAID))


def test_the_first_car_of_a_fleet_has_the_standard_port_and_no_other_car_wants_it(tmp_path):
    options = argparse.Namespace(assignments=[])
    fakes: list[Any] = [
        SimpleNamespace(name=f"car{k}", scene=SimpleNamespace(world=SimpleNamespace(name="loop"))) for k in (1, 2, 3)
    ]
    starts = [fleet.start_of(options, tmp_path / "car.toml", fake, Settings()) for fake in fakes]
    listens = [[one for one in start.assignments if one.startswith("telemetry.listen=")] for start in starts]
    assert listens[0] == []
    assert listens[1] != listens[2]
    assert all(len(listen) == 1 and "7447" not in listen[0] for listen in listens[1:])
    assert starts[0].listen == STANDARD
    assert starts[1].listen == ()
