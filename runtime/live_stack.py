"""The control code of one car: command queue, laws and limiter. Shared by the car's tasks and a replay.

`look` and `follow` answer one scan each: the law decides, the decision log keeps the result with the times that the law
read, and the answer goes into the command queue. `apply` changes all settings that decide in one step.
"""

from typing import Final

from wallride.drivers.api import Clock, Drive, MotorState, Scan
from wallride.runtime.arbitration.command import Decision, DriveCommand, SafetyAssessment, Source, SpeedLimit
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.localization.localizer import PoseEstimate
from wallride.runtime.control.perception.scan_rate import ScanRate
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import Settings

REQUIRED = frozenset({Source.SAFETY, Source.PERMIT})
"""Sources whose silence is a stop for every less urgent one."""
NO_SPEED: Final = "wall_follow.speed_mps is 0"


class LiveStack:
    """Built once from settings; without any memory of earlier runs.

    settings: those in force. decision_log: its clock is the one for all decisions. course: None for no map.
    """

    def __init__(self, settings: Settings, decision_log: DecisionLog, course: RaceCourse | None = None) -> None:
        self.settings = settings
        self.decision_log = decision_log
        self.clock: Clock = decision_log.clock
        self.queue = CommandQueue(settings.effective_order(), self.clock)
        self.laws = LiveLaws(settings.wall_follow, settings.safety, driven_car(settings), self.clock, course)
        self.course = course
        self.limiter = Limiter(settings.car)
        self._rate = ScanRate()
        self.answered_with: MotorState | None = None  # the report with which the newest scan was answered
        decision_log.add_settings(settings)

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Pass a scan to safety and put its speed limit.

        The limit is not a number but an assessment: the mux evaluates it for the very command that is about to be sent.
        It is in force only for a limited time after the scan, longer with a slow lidar: a blind safety is a silent one.
        """
        self.decision_log.begin()
        assessment = self.laws.look(scan, motor)
        self.decision_log.add_safety(scan, motor)
        word = SpeedLimit(Source.SAFETY, assessment, scan.stamp_s)
        waits_s = self._rate.note(scan.stamp_s)
        self.queue.put(word, expires_at_s=scan.stamp_s + self.settings.safety.expires_after_s + waits_s)
        return assessment

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Pass a scan to the follower and put its command; without an answer it is a standstill, with its reason."""
        self.decision_log.begin()
        guidance, self.answered_with = self.laws.follow(scan, motor), motor
        self.decision_log.add_follower(scan, motor, guidance)
        drive, reason = guidance.drive or Drive(0.0, 0.0), guidance.reason
        if guidance.drive is not None and drive.speed_mps == self.settings.wall_follow.speed_mps == 0.0:
            reason = NO_SPEED
        word = DriveCommand(Source.NAVIGATION, drive, scan.stamp_s, reason, guidance.stuck, guidance.promise)
        waits_s = self._rate.note(scan.stamp_s)
        self.queue.put(word, expires_at_s=scan.stamp_s + self.settings.wall_follow.expires_after_s + waits_s)
        return guidance

    def heed(self, decision: Decision) -> None:
        """Take note of what the mux has decided."""
        if (recovery := self.laws.recovery) is not None:
            recovery.driven = decision.driver is Source.NAVIGATION and decision.speed_mps != 0.0

    def locate(self, scan: Scan) -> PoseEstimate | None:
        """Return the pose at the scan that was answered last, by the same report; None without a map."""
        return self.course.localizer.localize(scan, self.answered_with) if self.course is not None else None

    def apply(self, settings: Settings) -> None:
        """Apply other settings in one step: between two scans, never within one.

        The very settings in force are no change: they try own laws with a fault again, in a replay as on the car.
        """
        if settings == self.settings:
            self.laws.retry_own_laws()
        self.settings = settings
        self.decision_log.add_settings(settings)
        self.laws.tune(settings.wall_follow, settings.safety)
        self.limiter.tune(settings.car)
        self.queue.reorder(settings.effective_order())
