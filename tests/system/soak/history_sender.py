"""A client of a random history: an operator or a planner, which says what it holds."""

from dataclasses import dataclass, field

from wallride.runtime.wire.teleop import Beat, Command, Input, Press


@dataclass
class Sender:
    """A client that says at every second step what it holds. deaf: hears no beat. late: its link holds all back.

    next_holds: what it will hold instead, each for some steps.
    """

    name: str
    session: int
    holds: Press | None = None
    deaf: bool = False
    late: list[Command] | None = None
    sequence: int = 0
    car_session: int = 0
    beat: int = 0
    next_holds: list[tuple[Press | None, int]] = field(default_factory=list)

    def hear(self, beat: Beat) -> None:
        if not self.deaf:
            self.car_session, self.beat = beat.car_session, beat.beat

    def turn(self) -> None:
        """Go on with what it will hold."""
        if self.next_holds:
            self.holds, steps = self.next_holds.pop(0)
            if steps > 1:
                self.next_holds.insert(0, (self.holds, steps - 1))

    def make(self, mark: float) -> Command | None:
        if self.holds is None:
            return None
        self.sequence += 1
        return Command(
            self.session, self.sequence, self.car_session, self.beat, self.holds, Input.SCRIPT, 0,
            0.8, mark, self.name,
        )  # fmt: skip
