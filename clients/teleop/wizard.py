"""Wizard that turns an unknown pad into a layout: push this, press that. Pure: events in, questions out."""

from collections.abc import Sequence

from wallride.clients.teleop import pad_files
from wallride.clients.teleop.inputs import CENTRED, STICKS, Control
from wallride.clients.teleop.pads import Axis, Binding, Button, Event, Hat, PadState

FAR = 0.7
QUESTIONS: Sequence[tuple[Control, str]] = (
    (Control.SPEED, "push the stick for the speed fully FORWARD, then let go"),
    (Control.STEERING, "push the stick for steering fully to the LEFT, then let go"),
    (Control.MANUAL, "press the deadman for driving by hand (usual: left bumper), then let go"),
    (Control.AUTONOMY, "press the permit for autonomy (usual: right bumper), then let go"),
    (Control.ESTOP, "press the e-stop (usual: the red button, B), then let go"),
    (Control.RESET, "press the button that resets an e-stop (usual: Start), then let go"),
    (Control.TAKE_OVER, "press the button that takes over from another operator (usual: Y), then let go"),
)


class Wizard:
    """Asks one question after the other. guid: of the pad. remark: fault of the last answer, "" without one."""

    def __init__(self, guid: str, name: str, rest: Sequence[float]) -> None:
        """Begin; rest: the value of every axis at rest."""
        self.guid = guid
        self._name = name
        self._state = PadState()
        for index, value in enumerate(rest):
            self._state.rest(index, value)
        self._rest = dict(enumerate(rest))
        self._candidate: Binding | None = None
        self._bindings: dict[Control, Binding] = {}
        self.remark = ""

    @property
    def question(self) -> str:
        """Return the present instruction; "" when all is known."""
        return "" if self.finished else QUESTIONS[len(self._bindings)][1]

    @property
    def finished(self) -> bool:
        """Return whether every control has its place."""
        return len(self._bindings) == len(QUESTIONS)

    def feed(self, event: Event, now_s: float) -> None:
        """Process one event of the pad."""
        self._state.apply(event, now_s)
        if self.finished:
            return
        control = QUESTIONS[len(self._bindings)][0]
        if self._candidate is None:
            self._candidate = self._stick(event) if control in STICKS else self._button(event)
        elif abs(self._state.read(self._candidate)) <= CENTRED:
            self._accept(control, self._candidate)
            self._candidate = None

    def toml(self) -> str:
        """Return the file's text, once finished."""
        return pad_files.to_toml(self.guid, self._name, self._bindings)

    def _stick(self, event: Event) -> Binding | None:
        """Return the axis that was pushed; forward and left shall read positive."""
        if isinstance(event, Hat):
            self.remark = "that is the D-pad (or MODE is on: its light must be off); use a stick"
            return None
        if not isinstance(event, Axis) or abs(event.value) < FAR:
            return None
        candidate = Binding("a", event.index, sign=1 if event.value > 0 else -1)
        if abs(self._rest.get(event.index, 0.0)) > CENTRED or self._state.read(candidate) != abs(event.value):
            self.remark = "that axis does not rest in its middle: a trigger cannot steer; use a stick"
            return None
        return candidate

    def _button(self, event: Event) -> Binding | None:
        match event:
            case Button(index, True):
                return Binding("b", index)
            case Hat(index, x, y) if (x, y) != (0, 0):
                return Binding("h", index, mask=(1 if y > 0 else 4) if y else (2 if x > 0 else 8))
            case Axis(index, value) if abs(value) > FAR and abs(value - self._rest.get(index, 0.0)) > FAR:
                return Binding("a", index, half=1 if value > 0 else -1)
            case _:
                return None

    def _accept(self, control: Control, found: Binding) -> None:
        taken = next(
            (
                name
                for name, at in self._bindings.items()
                if (at.kind, at.index) == (found.kind, found.index)
                and at.mask == found.mask
                and (not at.half or at.half == found.half)
            ),
            None,
        )
        if taken is not None:
            self.remark = f"that is {taken.value} already; choose another"
            return
        self.remark = ""
        self._bindings[control] = found
