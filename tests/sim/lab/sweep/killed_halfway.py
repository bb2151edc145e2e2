"""Fills a table with a sweep while something is killed half-way: `python -m` this module FILE TABLE processes|nodes.

processes: one of two on this machine; nodes: one of two of a Ray cluster on 127.0.0.1. A process of its own, because
Ray reads its environment at its import.
"""

import argparse
import json
import multiprocessing
import os
import sqlite3
import sys
import threading
import time
from contextlib import closing
from importlib import import_module
from pathlib import Path

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # Ray's switch for "stay on the loopback address"

from wallride import lab_options
from wallride.sim.lab.sweep.command import run
from wallride.sim.lab.sweep.plan import read_plan

NODE = {"num_cpus": 1, "node_ip_address": "127.0.0.1"}


def count(table):
    try:
        with closing(sqlite3.connect(f"file:{table}?mode=ro", uri=True)) as connection:
            return connection.execute("SELECT COUNT(*) FROM runs").fetchone()[0]
    except sqlite3.OperationalError:
        return 0


def main(file, table, what):
    half = len(read_plan(Path(file)).cells) // 2
    options = ["--jobs", "2"]
    if what == "nodes":
        cluster = import_module("ray.cluster_utils").Cluster(
            initialize_head=True, head_node_args={**NODE, "include_dashboard": False}
        )
        second = cluster.add_node(**NODE)
        options = ["--on", cluster.address]
    killed_at = []

    def kill():
        while (now := count(table)) < half:
            time.sleep(0.002)
        if what == "nodes":
            cluster.remove_node(second, allow_graceful=False)
        else:
            multiprocessing.active_children()[0].kill()
        killed_at.append(now)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    parser = argparse.ArgumentParser()
    lab_options.add(parser)
    code = run(parser.parse_args(["sweep", file, "--table", table, *options]))
    killer.join(10.0)
    if what == "nodes":
        cluster.shutdown()
    print("\n" + json.dumps({"code": code, "killed_at": killed_at}))  # noqa: T201 - the test reads it


if __name__ == "__main__":
    main(*sys.argv[1:])
