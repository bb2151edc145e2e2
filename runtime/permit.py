"""The operator's permit: autonomy moves by a positive, fresh signal, never by the absence of a joystick."""

from typing import Literal

from runtime.command import Source, consent, refusal
from runtime.voices import Voices

NOT_GRANTED = "no operator permits autonomy"


class Permit:
    """Speaks as Source.PERMIT: consent while granted, a stop otherwise.

    mode "always" is for simulation and benches: consent from the start, and revoking has no effect.
    """

    def __init__(self, voices: Voices, mode: Literal["required", "always"]) -> None:
        self._voices = voices
        self._always = mode == "always"
        if self._always:
            voices.say(consent(Source.PERMIT, "permit not required"))
        else:
            self.revoke(NOT_GRANTED)

    def grant(self, *, until_s: float) -> None:
        """Consent until then; the operator's client renews it. Afterwards the permit is silent, which is a stop."""
        if not self._always:
            self._voices.say(consent(Source.PERMIT, "operator permits"), expires_at_s=until_s)

    def revoke(self, reason: str) -> None:
        """Take the permit back, for example because a device was lost: coming back is not leave to drive on."""
        if not self._always:
            self._voices.say(refusal(Source.PERMIT, reason))
