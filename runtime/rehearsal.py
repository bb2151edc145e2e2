"""Goes the way from a scan to the motor's bytes once more, for nobody, just before the next scan is due.

Between two scans lie 25 ms in which everybody else on the computer takes the processor's caches, and the way through
cold code and data takes three times as long as through warm (docs/decisions/0013). The rehearsal is told the scan
before, has laws of its own and reaches no wire: whether it runs or not, every answer is the same.
"""

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from drivers.api import Clock, Drive, MotorState, Scan
from runtime.cadence import BEFORE_S
from runtime.command import CapWord, DriveWord, Source, arbitrate, consent
from runtime.control.limiter import Limiter
from runtime.control.live_laws import LiveLaws
from runtime.settings import Settings
from runtime.voices import Voices

log = logging.getLogger("wallride.rehearsal")

MARGIN_S: Final = 0.0007
"""It ends so long before the scan. With less, some end too late, and nothing is won: what is warm cools within 5 ms."""
GIVE_UP_S: Final = 0.0003
"""So long before the scan it begins no further piece; the longest piece takes 0.2 ms."""
LEARNING: Final = 0.1
"""By which a new duration counts among those before."""
FIRST_S: Final = 0.0008
_ELAPSED_S: Final = 0.025
_FOR_S: Final = 1.0


@dataclass(slots=True)
class Rehearsal:
    """Laws, voices and limiter that nobody hears.

    decode: decodes the newest scan again, for nobody. send: does what the motor's `send` does before it writes.
    required: as the mux has it. took_s: how long it usually takes.
    failed: it raised, was logged, and does nothing any more.
    """

    laws: LiveLaws
    voices: Voices
    limiter: Limiter
    required: frozenset[Source]
    clock: Clock
    decode: Callable[[], None]
    send: Callable[[Drive], None]
    took_s: float = FIRST_S
    failed: bool = False

    def __post_init__(self) -> None:
        """Permit it to drive."""
        self.voices.say(consent(Source.PERMIT, "only a rehearsal"))

    @property
    def lead_s(self) -> float:
        """How long before a scan it has to begin; infinity when it would disturb more than it helps."""
        lead_s = self.took_s + MARGIN_S
        return lead_s if lead_s < BEFORE_S else math.inf

    def tune(self, settings: Settings) -> None:
        """Go on with other settings, as the real laws do."""
        self.laws.tune(settings.wall_follow, settings.safety)
        self.voices.reorder(settings.effective_order())

    def run(self, scan: Scan, motor: MotorState | None, due_s: float) -> None:
        """Answer a scan that was answered already, before the next one is due; what there is no time for is left out.

        An error in it ends the rehearsals, not the drive.
        """
        if self.failed:
            return
        began_s = self.clock()
        try:
            for _ in self._pieces(scan, motor):
                if self.clock() > due_s - GIVE_UP_S:
                    break
        except Exception:
            self.failed = True
            log.exception("the rehearsal failed and is left out from here on; scans are answered as before, but slower")
        self.took_s += LEARNING * (self.clock() - began_s - self.took_s)

    def _pieces(self, scan: Scan, motor: MotorState | None) -> Iterator[None]:
        self.laws.forget()  # what is learnt later is on nobody's way to the motor
        expires_at_s = scan.stamp_s + _FOR_S
        self.decode()
        yield
        self.voices.say(CapWord(Source.SAFETY, self.laws.look(scan, motor), scan.stamp_s), expires_at_s=expires_at_s)
        yield
        guidance = self.laws.follow(scan, motor)
        yield
        drive = guidance.drive or Drive(0.0, 0.0)
        word = DriveWord(Source.NAVIGATION, drive, scan.stamp_s, guidance.reason)
        self.voices.say(word, expires_at_s=expires_at_s)
        decision = arbitrate(self.voices.live(), self.required, self.voices.order)
        self.send(self.limiter.limit(decision.speed_mps, decision.steering_rad, _ELAPSED_S, decision.brake_mps2))
