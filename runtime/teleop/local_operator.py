"""An operator's device on the car itself, as the car's process sees it: a client of the desk without a network."""

from typing import Never, Protocol


class LocalOperator(Protocol):
    """Answers heartbeats with commands, as a client over the network does; the desk judges both alike."""

    def hear(self, beat: bytes, arrival_s: float) -> None:
        """Take one heartbeat."""

    def command(self, now_s: float) -> bytes | None:
        """Return the command to the desk, None without a device; called at the rate of the heartbeats, never waits."""

    async def watch(self) -> Never:
        """Look for the device, for ever."""
