"""The operator's permit: autonomy moves by a positive, fresh signal, never by the absence of a joystick."""

import math
from typing import Literal

from wallride.runtime.arbitration.command import Source, consent, refusal
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.queues import NEVER_S

NOT_GRANTED = "no operator permits autonomy"
NOT_REQUIRED = "permit not required"


class Permit:
    """Limits the speed as Source.PERMIT: consent while granted, a stop otherwise.

    mode "required": consent only while an operator renews it. mode "always" is for simulation and benches: consent
    while there is no operator. A present operator may refuse it in this mode too, because a lost operator or one who
    drives by hand is a reason not to move.
    reason: the reason reported last. until_s: end of the consent; minus infinity while refused.
    """

    def __init__(self, queue: CommandQueue, mode: Literal["required", "always"]) -> None:
        self._queue = queue
        self.always = mode == "always"
        self.reason = ""
        self.until_s = -math.inf
        self.rest()

    def rest(self) -> None:
        """Return to the default without an operator, as the mode defines it."""
        if self.always:
            self.grant(until_s=NEVER_S, reason=NOT_REQUIRED)
        else:
            self.refuse(NOT_GRANTED)

    def grant(self, *, until_s: float, reason: str = "operator permits") -> None:
        """Consent until `until_s`; the operator's client renews it.

        Afterwards the permit is silent, which is a stop.
        """
        self.until_s, self.reason = until_s, reason
        self._queue.put(consent(Source.PERMIT, reason), expires_at_s=until_s)

    def refuse(self, reason: str) -> None:
        """Request a stop, in either mode; put once per reason."""
        if self.until_s > -math.inf or self.reason != reason:
            self.until_s, self.reason = -math.inf, reason
            self._queue.put(refusal(Source.PERMIT, reason))

    def revoke(self, reason: str) -> None:
        """Revoke a grant, for example because a device was lost: its return is no consent to drive on.

        No effect where no grant is needed, or none was given.
        """
        if not self.always and self.until_s > -math.inf:
            self.refuse(reason)
