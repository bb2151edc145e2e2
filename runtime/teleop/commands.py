"""The effect of an operator's acts on the mux: the teleop command and the permit, which change only together.

While a human drives, the permit refuses in either mode, so that the silence of teleop never releases autonomy. While an
operator is present at all, the permit's consent is a lease, so that it ends even if no task were left to notice.
"""

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import DriveCommand, Source
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.permit import NOT_GRANTED, NOT_REQUIRED, Permit
from wallride.runtime.teleop.status import OperatorState


class TeleopStatements:
    """Puts the operator's command and permit into the command queue.

    holding: what the last obeyed command held: MANUAL, AUTONOMY, or RELEASED.
    incident: why autonomy waits for an act of an operator, in the mode that needs no permit; "" when it does not.
    """

    def __init__(self, queue: CommandQueue, permit: Permit) -> None:
        self._queue = queue
        self._permit = permit
        self.holding = OperatorState.RELEASED
        self.incident = ""

    def drive(self, name: str, drive: Drive, *, until_s: float) -> None:
        """Put a manual drive command."""
        self.holding, self.incident = OperatorState.MANUAL, ""
        self._permit.refuse(f"{name} drives by hand")
        self._queue.put(DriveCommand(Source.TELEOP, drive, None, f"{name} drives"), expires_at_s=until_s)

    def permit(self, *, until_s: float) -> None:
        """Permit autonomy to move."""
        self._withdraw()
        self.holding, self.incident = OperatorState.AUTONOMY, ""
        self._permit.grant(until_s=until_s)

    def release(self, *, until_s: float) -> None:
        """Handle an explicit release: a stop, unless autonomy needs no permit and no act is awaited."""
        self._withdraw()
        if not self._permit.always:
            self.incident = ""  # here autonomy needs a press in any case
            self._permit.refuse(NOT_GRANTED)
        elif not self.incident:
            self._permit.grant(until_s=until_s, reason=NOT_REQUIRED)

    def halt(self, reason: str) -> None:
        """Stop; autonomy waits for an act of an operator, whatever the permit's mode."""
        self._withdraw()
        self.incident = reason
        self._permit.refuse(reason)

    def interrupt(self, reason: str) -> None:
        """End what the last command held: a stop; where it held nothing, only a granted permit is revoked."""
        if self.holding is OperatorState.RELEASED:
            self._permit.revoke(reason)
        else:
            self.halt(reason)

    def leave(self) -> None:
        """Return to the defaults without any operator."""
        self._withdraw()
        self.incident = ""
        self._permit.rest()

    def _withdraw(self) -> None:
        if self.holding is OperatorState.MANUAL:
            self._queue.withdraw(Source.TELEOP)
        self.holding = OperatorState.RELEASED
