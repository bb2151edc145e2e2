"""What safety `swept` remembers from scan to scan."""

import math
from typing import NamedTuple

from wallride.runtime.control.safety.emergency import Emergency
from wallride.runtime.control.safety.promise_record import NO_PROMISES, PromiseRecord
from wallride.runtime.control.safety.steering_reversal import SteeringReversal


class SweptMemory(NamedTuple):
    """All that a judgement remembers, from scan to scan: a value, of which each judgement returns the next.

    held_until_s: end of the hold of a hard stop. wary_until_s: end of the wary period. promises: what the source of the
    commands has kept of its promises.
    """

    held_until_s: float = -math.inf
    braking: bool = False
    wary_until_s: float = -math.inf
    reversal: SteeringReversal = SteeringReversal()
    emergency: Emergency = Emergency()
    promises: PromiseRecord = NO_PROMISES
