"""Gradients a second of a search on two workers against the search in one process on both cores.

    python assets/cluster/two_workers.py

Both are run in turn, each for the same number of gradients with twice the chains of a worker in the one
process. The rate is per second of wall time; beside it stands the rate per second of processor time of
all processes, which a machine that others use changes less. Starting Ray, actor and workers is not counted:
the watch runs from the first outcomes to the last one.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from statistics import median

import aplanat
from aplanat import ray as cluster

# Ray's workers would yield to every other process of the machine.
os.environ.setdefault("RAY_worker_niceness", "0")


def ticks_of_children() -> float:
    """The processor seconds of all processes that descend from this one and still run."""
    import kill_workers

    tree = kill_workers.parents()
    total = 0
    for process in tree:
        above = process
        while above and above != os.getpid():
            above = tree.get(above, 0)
        if above and process != os.getpid():
            try:
                with open(f"/proc/{process}/stat", encoding="utf-8", errors="replace") as file:
                    user, system = file.read().rpartition(")")[2].split()[11:13]
            except OSError:
                continue
            total += int(user) + int(system)
    return total / os.sysconf("SC_CLK_TCK")


def run_one(lens: aplanat.Lens, chains: int, gradients: int, seed: int) -> tuple[float, float]:
    """Gradients per second and per processor second of the search in this process."""
    settings = {"seed": seed, "chains": 2 * chains, "gradients": gradients}
    search = aplanat.Search(lens, {"settings": settings})
    begin, processor = time.perf_counter(), time.process_time()
    *_, progress = search
    taken = progress.statistics["gradients"]
    return taken / (time.perf_counter() - begin), taken / (time.process_time() - processor)


def run_two(
    lens: aplanat.Lens, chains: int, gradients: int, period: int, seed: int
) -> tuple[float, float]:
    """The same of the search on two workers, from its first period to its last."""
    plan, first = {"settings": {"seed": seed, "chains": chains}}, None
    for progress in cluster.search(lens, plan, gradients=gradients, groups=2, period=period):
        if first is None:
            first, processor = progress, ticks_of_children()
        spent = ticks_of_children() - processor
    taken = progress.gradients - first.gradients
    return taken / (progress.seconds - first.seconds), taken / spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lens", default="cooke_triplet_100_f27", help="the name of a bundled lens")
    parser.add_argument("--gradients", type=int, default=16_000)
    parser.add_argument("--period", type=int, default=1000)
    parser.add_argument("--chains", type=int, default=4, help="chains of a worker")
    parser.add_argument("--turns", type=int, default=5)
    options = parser.parse_args()
    lens = aplanat.Lens.bundled(options.lens)
    cluster.connect(2)
    # Workers that have been started are used again.
    run_two(lens, options.chains, 8 * options.period, options.period, 0)
    rows = []
    for seed in range(1, options.turns + 1):
        one = run_one(lens, options.chains, options.gradients, seed)
        two = run_two(lens, options.chains, options.gradients, options.period, seed)
        rows.append((*one, *two, two[0] / one[0], two[1] / one[1]))
    names = ("one", "one_per_processor_second", "two", "two_per_processor_second")
    names += ("ratio", "ratio_per_processor_second")
    figures = {name: median(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
    ratios = [round(row[4], 3) for row in rows]
    print(json.dumps({"lens": options.lens, "gradients_a_second": figures, "ratios": ratios}, indent=2))


if __name__ == "__main__":
    main()
