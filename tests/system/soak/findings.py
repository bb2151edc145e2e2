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

    memory_bytes: resident. own_bytes: what it has taken itself, in memory or swapped out; not the pages of programs
    and libraries, which the kernel loads when they are first run and drops when it wants to.
    """

    own_bytes: list[int] = field(default_factory=list)
    memory_bytes: list[int] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)

    def sample(self, pid: int) -> None:
        """Take one sample."""
        rows = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
        sizes_kb = {row.split()[0]: int(row.split()[1]) for row in rows if row.endswith(" kB")}
        self.memory_bytes.append(sizes_kb["VmRSS:"] * 1024)
        self.own_bytes.append((sizes_kb["RssAnon:"] + sizes_kb["RssShmem:"] + sizes_kb["VmSwap:"]) * 1024)
        self.descriptors.append(len(list(Path(f"/proc/{pid}/fd").iterdir())))
