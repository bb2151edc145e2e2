"""Cost of processes, from /proc: CPU time to the nanosecond, memory, threads; and the use by all others meanwhile."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

_PROC = Path("/proc")
_TICK_HZ = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Cost:
    """cpu: cores, by thread name. pss_mib: memory, shared pages in proportion. others: cores that others used."""

    cpu: Mapping[str, float]
    pss_mib: float
    threads: int
    others: float

    @property
    def cores(self) -> float:
        """Return the cores of all threads together."""
        return sum(self.cpu.values())


class ProcessMeter:
    """Measures processes from now until `stop`. began_s: when that began (monotonic)."""

    def __init__(self, pids: Sequence[int]) -> None:
        self._pids = pids
        self.began_s = time.monotonic()
        self._threads_s = _threads_s(pids)
        self._machine_s = _machine_s()

    @classmethod
    def of(cls, pid: int) -> Self:
        """Measure one process."""
        return cls([pid])

    def stop(self) -> Cost:
        """Return the cost since the start."""
        elapsed_s = time.monotonic() - self.began_s
        cpu: dict[str, float] = {}
        for thread, spent_s in _threads_s(self._pids).items():
            name = thread[1]
            cpu[name] = cpu.get(name, 0.0) + (spent_s - self._threads_s.get(thread, 0.0)) / elapsed_s
        others = (_machine_s() - self._machine_s) / elapsed_s - sum(cpu.values())
        pss_kib = sum(_pss_kib(pid) for pid in self._pids)
        threads = sum(len(list((_PROC / str(pid) / "task").iterdir())) for pid in self._pids)
        return Cost({name: used for name, used in cpu.items() if used > 0}, pss_kib / 1024, threads, others)


def _threads_s(pids: Sequence[int]) -> dict[tuple[str, str], float]:
    """Return the CPU time of every thread; ended threads are missing."""
    spent: dict[tuple[str, str], float] = {}
    for pid in pids:
        for task in (_PROC / str(pid) / "task").iterdir():
            name = (task / "comm").read_text().strip()
            spent[task.name, name] = int((task / "schedstat").read_text().split()[0]) / 1e9
    return spent


def _machine_s() -> float:
    """Return the CPU time of all cores together."""
    fields = [int(text) for text in (_PROC / "stat").read_text().splitlines()[0].split()[1:]]
    return (sum(fields[:8]) - fields[3] - fields[4]) / _TICK_HZ


def _pss_kib(pid: int) -> int:
    for line in (_PROC / str(pid) / "smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1])
    return 0
