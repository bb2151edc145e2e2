"""Numbers of the lab report that the references hold, each with its place; what they do not hold is named too."""

from sim.lab.report.plan import REPORT_KD, REPORT_KP
from sim.lab.walls import REPORT_TABLE_M

STOPPED, OBSTACLES = 26, 28
STOP_BELOW_M, TURN_BELOW_M = 0.9329, 1.5
NOTES_TABLE_M = REPORT_TABLE_M
"""The report's law in the design notes' simulator: 20 degree starts at 0.5 and 1.5 m, friction 0.8, 1 to 4 m/s."""
GAINS = (
    f"The report: two gain tables of 12 pairs each; the average of the optima is Kp {REPORT_KP:g}, Kd {REPORT_KD:g}."
    " The references do not hold its pairs, its optima or its errors: the pairs here are ours."
)
TRIALS = (
    "The report: the references do not hold its trials. The design notes' own run of its law (20 degree starts,"
    " another simulator) stands in the column beside."
)
OBSTACLES_SAID = (
    f"The report: {STOPPED} of {OBSTACLES} stopped; it stops nearer than {STOP_BELOW_M:g} m ahead and turns away nearer"
    f" than {TURN_BELOW_M:g} m, at any speed. The references do not say which two it hit."
)
