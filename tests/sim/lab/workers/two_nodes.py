"""Runs slow cells on a Ray cluster of two nodes on 127.0.0.1, and kills one half-way: `python -m` this module.

A process of its own: Ray reads its environment at its import. Prints one JSON line of [cell, figures, error].
"""

import json
import os
from importlib import import_module

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # Ray's switch for "stay on the loopback address"

from sim.lab.workers.submit import submit
from tests.sim.lab.workers.works import slowly

CELLS = [*range(60), -1]
NODE = {"num_cpus": 1, "node_ip_address": "127.0.0.1"}


def main():
    cluster = import_module("ray.cluster_utils").Cluster(
        initialize_head=True, head_node_args={**NODE, "include_dashboard": False}
    )
    second = cluster.add_node(**NODE)
    ended = []
    for done in submit(CELLS, slowly, on=cluster.address):
        ended.append([done.cell, done.figures, done.error])
        if len(ended) == len(CELLS) // 2:
            cluster.remove_node(second, allow_graceful=False)
    cluster.shutdown()
    print("\n" + json.dumps(ended))  # noqa: T201 - the test reads it


if __name__ == "__main__":
    main()
