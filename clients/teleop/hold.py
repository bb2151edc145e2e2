"""Deliberate press: one button alone, held for a while, and counted once."""

HOLD_S = 1.0
INSIST_S = 1.0
"""Duration of repeating an accepted press to the car; then it must be released, lest it undo what comes later."""


class Hold:
    """Watches one button. Begins only after the button was seen released, because a stuck button is not a request."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._spent = True

    def update(self, now_s: float, *, held: bool, alone: bool) -> bool:
        """Return whether to send the request now.

        held: the button is down. alone: nothing else is, and the device and the link are well.
        """
        if not held:
            self._since_s, self._spent = None, False
        elif self._spent or not alone:
            self._since_s, self._spent = None, True
        elif self._since_s is None:
            self._since_s = now_s
        elif now_s - self._since_s > HOLD_S + INSIST_S:
            self._since_s, self._spent = None, True
        return self._since_s is not None and now_s - self._since_s >= HOLD_S

    def done(self) -> None:
        """Record that the car did it: nothing more is sent until the button was released."""
        self._since_s, self._spent = None, True

    def progress(self, now_s: float) -> float:
        """Return the progress of the hold, 0 to 1; 0 when it does not count."""
        return 0.0 if self._since_s is None else min(1.0, (now_s - self._since_s) / HOLD_S)
