"""Histograms of latencies as PNG."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from wallride.runtime.host.output_files import write_file

mpl.use("agg")


def histogram(file: Path, title: str, samples_ms: Mapping[str, Sequence[float]]) -> None:
    """Draw distributions over each other, on a logarithmic time axis, with p50 and p99 as lines."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.add_subplot()
    every = np.concatenate([np.asarray(list(samples)) for samples in samples_ms.values()])
    bins = np.geomspace(max(every.min(), 0.01), every.max() * 1.01, 80)
    for name, samples in samples_ms.items():
        p50_ms, p99_ms = np.percentile(samples, [50, 99])
        label = f"{name}: p50 {p50_ms:.2f} ms, p99 {p99_ms:.2f} ms, n {len(samples)}"
        shares, _ = np.histogram(samples, bins)
        (line,) = axes.plot(bins[1:], shares / len(samples), drawstyle="steps-pre", label=label)
        for value_ms, style in ((p50_ms, "-"), (p99_ms, ":")):
            axes.axvline(value_ms, color=line.get_color(), linestyle=style, linewidth=0.8)
    axes.set(xscale="log", xlabel="scan to command [ms]", ylabel="share of scans", title=title)
    axes.legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    write_file(file, lambda drawn: figure.savefig(drawn, format="png", dpi=110))
