"""Faults of the user's own laws: the permit ends with one, and the next permit tries the law again."""

import logging
import math
from collections.abc import Callable

from drivers.api import Clock
from runtime.arbitration.permit import Permit
from runtime.control.live_laws import LiveLaws

log = logging.getLogger("wallride.own_law")

RETRY_S = 2.0
"""Delay before a new try where no permit is required (permit "always"); doubled with each fault."""
MAX_RETRY_S = 60.0
FORGOTTEN_S = 30.0
"""Time without a fault after which the next one is retried after the shortest delay again."""


class OwnLawWatch:
    """The stop itself is the law's answer; this decides when the law is asked again.

    rearm: called with the reason, so that no button that is held permits any longer. retry: makes the law anew.
    """

    def __init__(
        self, laws: LiveLaws, permit: Permit, rearm: Callable[[str], None], retry: Callable[[], None], clock: Clock
    ) -> None:
        self._laws, self._permit, self._rearm, self._retry, self._clock = laws, permit, rearm, retry, clock
        self._faults = 0
        self._refused = False
        self._fault_s = -math.inf
        self._retry_after_s = RETRY_S

    def tick(self, _late_s: float, _missed: int) -> None:
        """Check once; a `periodic.Tick`."""
        fault, faults, granted = self._laws.own_law_fault, self._laws.own_law_faults, self._permit.until_s > -math.inf
        if faults != self._faults:
            self._faults = faults
            if fault:
                self._note(fault, granted=granted)
        elif fault:
            self._refused |= not granted
            due = self._permit.always and self._clock() - self._fault_s > self._retry_after_s
            if granted and (self._refused or due):
                log.info("trying again: %s", fault)
                self._retry()

    def _note(self, fault: str, *, granted: bool) -> None:
        """Take in a new fault."""
        log.error("%s", fault)
        now_s = self._clock()
        soon = now_s - self._fault_s < self._retry_after_s + FORGOTTEN_S
        self._retry_after_s = min(2 * self._retry_after_s, MAX_RETRY_S) if soon else RETRY_S
        self._fault_s, self._refused = now_s, not granted
        if granted:
            self._rearm(f"{fault}; permit again")
