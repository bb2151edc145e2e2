"""Faults of the user's own laws: the permit ends with one, and the next permit tries the law again."""

import logging
import math
from collections.abc import Callable, Sequence

from wallride.drivers.api import Clock
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.own_laws.runner import LawRunner
from wallride.runtime.host.rate_limited_log import RateLimitedLog
from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD
from wallride.runtime.host.user_module import shown
from wallride.runtime.host.user_threads import threads_of

log = logging.getLogger("wallride.own_law")

RETRY_S = 2.0
"""Delay before a new try where no permit is required (permit "always"); doubled with each fault."""
MAX_RETRY_S = 60.0
FORGOTTEN_S = 30.0
"""Time without a fault after which the next one is retried after the shortest delay again."""
LOOK_EVERY_S = 1.0
GAP_S = 0.05
"""Delay of the loop for which threads of a law are named: two scans."""


class OwnLawWatch:
    """The stop itself is the law's answer; this decides when the law is asked again, and what else it may take.

    rearm: called with the reason, so that no button that is held permits any longer. retry: makes the law anew.
    words: what the laws take from the process.
    """

    def __init__(
        self, laws: LiveLaws, permit: Permit, rearm: Callable[[str], None], retry: Callable[[], None], clock: Clock
    ) -> None:
        self.words: tuple[str, ...] = ()
        self._laws, self._permit, self._rearm, self._retry, self._clock = laws, permit, rearm, retry, clock
        self._log = RateLimitedLog(log, clock)
        self._seen: dict[LawRunner, int] = {}
        self._refused = False
        self._fault_s = self._looked_s = -math.inf
        self._retry_after_s = RETRY_S

    def tick(self, late_s: float, _missed: int) -> None:
        """Check once; a `periodic.Tick`."""
        runners, granted = self._laws.runners, self._permit.until_s > -math.inf
        failed = [runner.last_fault for runner in runners if runner.faults != self._seen.get(runner, 0)]
        self._seen = {runner: runner.faults for runner in runners}
        if failed:  # also where the law was tried again since
            self._note("; ".join(failed), granted=granted)
        elif fault := self._laws.own_law_fault:
            self._refused |= not granted
            due = self._permit.always and self._clock() - self._fault_s > self._retry_after_s
            if granted and (self._refused or due):
                log.info("trying again: %s", fault)
                self._retry()
        self._guard_the_process(runners, late_s)

    def _guard_the_process(self, runners: Sequence[LawRunner], late_s: float) -> None:
        """Name threads of the laws, which take their time from the loop; hold the signals, against drivers as well."""
        if late_s < GAP_S and self._clock() - self._looked_s < LOOK_EVERY_S:
            return
        self._looked_s = self._clock()
        STOP_SIGNALS_HELD.put_back()
        words = tuple(
            f"{runner.law.name} runs {count} thread{'s' if count > 1 else ''} of its own ({shown(path)}:{line}),"
            f" which {'take' if count > 1 else 'takes'} time from driving"
            for runner in runners
            for count, path, line in [threads_of(runner.law.file)]
            if count
        )
        if words and words != self.words:
            self._log.log("threads", "; ".join(words))
        if words and late_s >= GAP_S:
            self._log.log("gap", f"the car was held up for {1000 * late_s:.0f} ms: {'; '.join(words)}")
        self.words = words

    def _note(self, fault: str, *, granted: bool) -> None:
        """Take in a new fault."""
        log.error("%s", fault)
        now_s = self._clock()
        soon = now_s - self._fault_s < self._retry_after_s + FORGOTTEN_S
        self._retry_after_s = min(2 * self._retry_after_s, MAX_RETRY_S) if soon else RETRY_S
        self._fault_s, self._refused = now_s, not granted
        if granted:
            self._rearm(f"{fault}; permit again")
