"""Memory of the page and its server while a simulated car drives, and what restarts leave of the page's plots.

WALLRIDE_SOAK_MINUTES=30 makes it long; with pytest -s it prints its table. The default only sees that it works.
"""

import asyncio
import os
import signal
import statistics
import sys
import time
from pathlib import Path

import pytest

from tests.system.watched import watched

MINUTES = float(os.environ.get("WALLRIDE_SOAK_MINUTES", "0.15"))
EVERY_S = 30.0 if MINUTES >= 2 else 1.5
LONG = 20
"""From so many samples on, growth is judged strictly; before, everything is still warming up."""
LIMITS = {"server_own_mib": (8.0, 1.5), "heap_mb": (2.0, 0.3), "page_own_mib": (40.0, 8.0)}
"""What may come on top from the first fifth to the last fifth of a short, and of a long time."""
AWAY_S = 2.0
BACK_WITHIN_S = 20.0

pytestmark = pytest.mark.timeout(MINUTES * 60 + 120)

MARK = """(() => {
  window.marked = wallride.plots.strips.map(({ lines }) => lines.map(({ series }) => {
    const i = series.at(0);
    return { ms: series.t[i], v: series.v[i] };
  }));
  window.markedMs = performance.now();
  return wallride.plots.samples;
})()"""
KEPT = """wallride.plots.strips.every(({ lines }, s) => lines.every(({ series }, l) => {
  const mark = window.marked[s][l];
  for (let k = 0; k < series.count; k++) {
    const i = series.at(k);
    if (series.t[i] === mark.ms) return Object.is(series.v[i], mark.v);
  }
  return false;
}))"""
NEWER = """wallride.plots.strips.every(({ lines }) => lines.every(({ series }) =>
  performance.now() - series.t[series.at(0)] < 2500 && series.t[series.at(0)] > window.markedMs))"""
FRESH = "document.body.dataset.linked === 'true' && document.querySelector('#view').dataset.old === 'false'"


def memory_mib(pid):
    """Return a process's PSS, which falls when others come to share its libraries, and what is its own alone."""
    lines = (line.split() for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:])
    kib = {words[0].rstrip(":"): int(words[1]) for words in lines}
    return kib["Pss"] / 1024, (kib["Private_Clean"] + kib["Private_Dirty"]) / 1024


async def sample(scene, began_s):
    """Measure now, after the page's garbage is gone."""
    await scene.page.call("HeapProfiler.collectGarbage")
    metrics = {entry["name"]: entry["value"] for entry in (await scene.page.call("Performance.getMetrics"))["metrics"]}
    server, page = memory_mib(scene.monitor.process.pid), max(map(memory_mib, scene.browser.renderers()))
    return {
        "minutes": (time.monotonic() - began_s) / 60,
        "server_pss_mib": server[0],
        "server_own_mib": server[1],
        "heap_mb": metrics["JSHeapUsedSize"] / 1e6,
        "page_pss_mib": page[0],
        "page_own_mib": page[1],
        "nodes": metrics["Nodes"],
        "scans": await scene.page.run("wallride.timings.count"),
    }


def show(rows):
    """Print the newest row, the first one with a head, for `pytest -s`."""
    if len(rows) == 1:
        sys.stdout.write("\n" + "  ".join(f"{name:>14}" for name in rows[0]) + "\n")
    sys.stdout.write("  ".join(f"{value:14.2f}" for value in rows[-1].values()) + "\n")
    sys.stdout.flush()


def growth(rows, name):
    """Return how much more it was in the last fifth than in the first; the very first sample is a warm-up."""
    values = [row[name] for row in rows[1:]]
    fifth = max(1, len(values) // 5)
    return statistics.median(values[-fifth:]) - statistics.median(values[:fifth])


async def test_memory_stays_flat_and_restarts_leave_the_plots(tmp_path):
    longest_s = MINUTES * 60 + 100
    async with watched(tmp_path, "loop", "recording.enabled=false", longest_s=longest_s) as scene:
        page = await scene.open()
        await page.call("Performance.enable")
        await page.run("document.querySelector('#settings').open = true")
        await page.run("document.querySelector('button[value=\"300\"]').click()")
        began_s, rows = time.monotonic(), []
        while time.monotonic() - began_s < MINUTES * 60:
            await asyncio.sleep(EVERY_S)
            rows.append(await sample(scene, began_s))
            show(rows)
        await restart(scene, scene.monitor, signal.SIGKILL, "the server")
        await restart(scene, scene.car, signal.SIGTERM, "the car")
        rows.append(await sample(scene, began_s))
        show(rows)
        # A browser notes every attempt to reach a server that is not there.
        assert [error for error in page.errors if "ERR_CONNECTION" not in error and "WebSocket" not in error] == []
    strict = len(rows) > LONG
    for name, limits in LIMITS.items():
        grown = growth(rows[:-1], name)
        sys.stdout.write(f"{name}: {grown:+.2f}, at most {limits[strict]:g}\n")
        assert grown <= limits[strict], name
    assert rows[-1]["scans"] > rows[0]["scans"]


async def restart(scene, program, how, what):
    """End a program, start it again, and look whether the page goes on by itself, with all that it had."""
    page = scene.page
    samples = await page.run(MARK)
    assert samples > 100
    await program.end(how)
    await page.until("document.querySelector('#view').dataset.old === 'true'")
    await asyncio.sleep(AWAY_S)
    await program.start()
    began_s = time.monotonic()
    await page.until(FRESH, within_s=BACK_WITHIN_S)
    back_s = time.monotonic() - began_s
    await page.until(NEWER, within_s=BACK_WITHIN_S)
    assert await page.run(KEPT), f"what was plotted before {what} restarted is still there, in a page not loaded anew"
    sys.stdout.write(f"{what} restarted: the page shows it again {back_s:.1f} s after its start, with its plots\n")
