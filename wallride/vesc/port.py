"""Whether a car's own program has the VESC now: then nothing is written into it."""

from wallride.doctor.computer import Computer
from wallride.doctor.examine import ACTIVE, STOP_FIRST
from wallride.doctor.findings import Level
from wallride.doctor.ports import check_ports
from wallride.runtime.settings.tree import Settings
from wallride.vesc.change import VescChangeError


def refuse_taken_port(computer: Computer, settings: Settings) -> None:
    """Raise VescChangeError where the service runs, or the port is missing, forbidden or held."""
    if computer.path(ACTIVE).is_symlink():
        raise VescChangeError(f"the car's service runs and may drive: {STOP_FIRST}")
    for finding in check_ports(computer, settings):
        if finding.subject == "motor port" and finding.level is Level.FAIL:
            raise VescChangeError(f"{finding.words}; {finding.remedy}")
