"""What a soak finds: violations, how much was judged, and the resources of the car's process."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Findings:
    """What a soak found. commands, moving: motor commands judged; faults: begun, by kind; contacts: of the car.

    touches: a line for each contact.
    """

    seconds: float
    violations: dict[str, int]
    kept: list[str]
    commands: int
    moving: int
    faults: dict[str, int]
    way_m: float
    contacts: int
    touches: list[str]


@dataclass
class Resources:
    """Memory and descriptors of the car's process over time, sampled while no fault is active.

    memory_bytes: resident. own_bytes: of these without the pages of files, which other processes share.
    """

    own_bytes: list[int] = field(default_factory=list)
    memory_bytes: list[int] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)

    def sample(self, pid: int) -> None:
        """Take one sample."""
        rows = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()[1:]
        sizes_kb = {row.split()[0]: int(row.split()[1]) for row in rows}
        self.memory_bytes.append(sizes_kb["Rss:"] * 1024)
        self.own_bytes.append((sizes_kb["Anonymous:"] + sizes_kb["Swap:"]) * 1024)
        self.descriptors.append(len(list(Path(f"/proc/{pid}/fd").iterdir())))
