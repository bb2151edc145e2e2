"""The operator's permit: autonomy moves by a positive, fresh signal, never by the absence of a joystick."""

import math
from typing import Literal

from runtime.arbitration.command import Source, consent, refusal
from runtime.arbitration.command_queue import CommandQueue
from runtime.arbitration.queues import NEVER_S

NOT_GRANTED = "no operator permits autonomy"
NOT_REQUIRED = "permit not required"


class Permit:
    """Speaks as Source.PERMIT: consent while granted, a stop otherwise.

    mode "required": consent only while an operator renews it.
    mode "always" is for simulation and benches: consent while there is no operator. A present operator may
    refuse it in this mode too, because a human who was lost or who drives by hand is a reason not to move.
    reason: the words said last. until_s: when the consent ends; minus infinity while refused.
    """

    def __init__(self, voices: CommandQueue, mode: Literal["required", "always"]) -> None:
        self._voices = voices
        self.always = mode == "always"
        self.reason = ""
        self.until_s = -math.inf
        self.rest()

    def rest(self) -> None:
        """Go back to what holds without an operator: the mode decides."""
        if self.always:
            self.grant(until_s=NEVER_S, reason=NOT_REQUIRED)
        else:
            self.refuse(NOT_GRANTED)

    def grant(self, *, until_s: float, reason: str = "operator permits") -> None:
        """Consent until then; the operator's client renews it. Afterwards the permit is silent, which is a stop."""
        self.until_s, self.reason = until_s, reason
        self._voices.say(consent(Source.PERMIT, reason), expires_at_s=until_s)

    def refuse(self, reason: str) -> None:
        """Want the car to stand, in either mode; said once per reason."""
        if self.until_s > -math.inf or self.reason != reason:
            self.until_s, self.reason = -math.inf, reason
            self._voices.say(refusal(Source.PERMIT, reason))

    def revoke(self, reason: str) -> None:
        """Take a grant back, for example because a device was lost: coming back is not leave to drive on.

        Nothing changes where no grant is needed, or none was given.
        """
        if not self.always and self.until_s > -math.inf:
            self.refuse(reason)
