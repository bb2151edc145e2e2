"""The settings of a driving car as a mapping: `car.parameters["wall_follow.kp"] = 10`."""

import getpass
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from wallride.clients.parameters import MAX_NAME_LENGTH

Ask = Callable[..., Mapping[str, Any]]


class RemoteParameters:
    """Settings by their dotted names; a change takes effect at once, or is refused whole (RefusedError).

    ask: sends one question to the car's parameter server.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask
        self._by = ""
        with suppress(KeyError, OSError):  # a user without a name, as in some containers
            self._by = getpass.getuser()[:MAX_NAME_LENGTH]

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - a number, text, flag or list
        return self._ask("get", names=[name])["values"][name]

    def __setitem__(self, name: str, value: object) -> None:
        self.update({name: value})

    def __iter__(self) -> Iterator[str]:
        return iter(self.describe())

    def update(self, values: Mapping[str, object]) -> None:
        """Change several settings, all or none."""
        self._ask("set", values=dict(values), by=self._by)

    def describe(self, under: str = "") -> dict[str, Mapping[str, Any]]:
        """Return value, default, range, unit and sentence of each setting whose name begins so."""
        return {entry["name"]: entry for entry in self._ask("list", under=under)["parameters"]}

    def save(self) -> None:
        """Write the changes to the car's settings file."""
        self._ask("save", by=self._by)
