"""The installed program: compiled functions, own laws, service."""

from typing import Final

from wallride.doctor.computer import Computer
from wallride.doctor.condition import UNIT
from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.doctor.ports import RULES
from wallride.runtime.control.laws import own_law_mistakes
from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.runtime.host.ownership import changed_by_others
from wallride.runtime.kernel import state
from wallride.runtime.line_files import read_course, why_no_line
from wallride.runtime.map_files import MapError
from wallride.runtime.settings.tree import Settings

WANTED: Final = "/etc/systemd/system/multi-user.target.wants/wallride.service"
BUILD: Final = "wallride build-kernel"


def check_program(computer: Computer, settings: Settings) -> list[Finding]:
    """Look at the program."""
    kernel = state()
    mistakes = own_law_mistakes(settings.wall_follow, settings.safety, settings.car)
    return [
        judge_kernel(kernel.words, complete=not kernel.in_python),
        *(fail("own laws", mistake, "correct the law; wallride check names the place") for mistake in mistakes),
        *(warn("own laws", words, remedy) for words, remedy in laws_open_to_others()),
        *check_course(settings),
        _service(computer),
    ]


def check_course(settings: Settings) -> list[Finding]:
    """Look at the map and its line, where the settings name a map or a law that needs one."""
    try:
        course = read_course(settings.map, settings.car)
    except MapError as error:
        return [fail("map", str(error), "correct map.file and map.line: the car does not start with them")]
    if words := why_no_line(settings.wall_follow, settings.map):
        return [warn("map", f"{words}: the car follows the wall", "docs/racing.md")]
    if course is None:
        return []
    return [ok("map", f"{course.name}, {'with' if course.line is not None else 'without'} a race line")]


def laws_open_to_others() -> list[tuple[str, str]]:
    """Return what is to be said, and done, of each imported law that others may exchange."""
    found = {file: changed_by_others(file) or changed_by_others(file.parent) for file in loaded_files()}
    remedy = "move it to /etc/wallride/laws, which is root's; root does not load it from here"
    return [(f"{file} may be exchanged: {why}", remedy) for file, why in found.items() if why]


def judge_kernel(words: str, *, complete: bool) -> Finding:
    """Judge the compiled functions by the kernel's own words."""
    if complete:
        return ok("compiled functions", words)
    if "edited" in words:
        remedy = f"an edited law runs in Python: declare the C equal by {BUILD} --seal, or undo the edit"
    else:
        remedy = f"sudo apt install gcc python3-dev, then {BUILD}"
    return warn("compiled functions", f"{words}: the car answers a scan later", remedy)


def _service(computer: Computer) -> Finding:
    install = "sudo wallride service install"
    missing = [
        words
        for name, words in ((UNIT, "the unit"), (RULES, "the udev rules"))
        if not computer.path(name).is_file()
    ]  # fmt: skip
    if missing:
        return warn("service", f"{' and '.join(missing)} not installed: the car starts by hand only", install)
    if not computer.path(WANTED).is_symlink():
        return warn("service", "does not start at boot", "sudo systemctl enable wallride")
    return ok("service", "installed, starts at boot")
