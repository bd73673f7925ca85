"""The efficiency of the scheduling of a search at 1 to 512 simulated workers.

    python assets/cluster/scheduling.py --seconds 10

A simulated worker sleeps as long as a period and its judgement take, and returns the real outcome of a
short one with its verdict. Actor, checkpoint and messages are those of a real search. Efficiency is the
time that all workers slept over the time that all of them were there. The traffic of 1,000 machines
follows from the sizes of a real period and outcome, and from the processor time of the actor.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import pickle
import tempfile
import time
from pathlib import Path
from typing import Any

import aplanat
from aplanat import ray as cluster
from aplanat.ray.actor import RayMachines, SearchActor
from aplanat.ray.coordinator import SHARED

# Ray's workers would yield to every other process of the machine.
os.environ.setdefault("RAY_worker_niceness", "0")

Judged = tuple[cluster.Outcome, cluster.Verdict]

HALL = 64
"""Simulated workers of a process."""


def seed_of(period: cluster.Period) -> int:
    """The seed of the group of a period."""
    return json.loads(period.plan)["settings"]["seed"]


class Hall:
    """Workers that sleep."""

    def __init__(self, outcomes: dict[int, Judged], seconds: float) -> None:
        self.outcomes, self.seconds = outcomes, seconds

    async def work(self, period: cluster.Period) -> Judged:
        """Sleeps as long as a period and its judgement take."""
        await asyncio.sleep(self.seconds)
        return self.outcomes[seed_of(period)]


class SleepingMachines(RayMachines):
    """Machines of Ray that are halls of workers that sleep."""

    def __init__(self, halls: list[Any]) -> None:
        super().__init__()
        self.halls = halls

    def begin(self, period: cluster.Period) -> Any:
        """Begins a period in the hall of its group."""
        hall = self.halls[seed_of(period) // HALL % len(self.halls)]
        return self._expect(*hall.work.options(num_returns=2).remote(period))

    def free(self, busy: int) -> int:
        """None: every group has its worker."""
        return 0


def judge_first(search: cluster.Coordinator) -> dict[int, Judged]:
    """A real first outcome of every group, with its verdict."""
    found = {}
    for period in (search.begin(i) for i in search.ready()):
        outcome = cluster.work(period)
        found[seed_of(period)] = outcome, cluster.judge(period, outcome)
    return found


def processor_seconds(process: int) -> float:
    """The time that a process has had a core."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def simulate(lens: aplanat.Lens, plan: dict, workers: int, seconds: float, periods: int) -> dict:
    """A search with a group for every worker."""
    import ray

    short = 4  # gradients
    search = cluster.Coordinator(lens, plan, short * workers * periods, workers, short)
    outcomes = ray.put(judge_first(search))
    halls = -(-workers // HALL)
    hall = ray.remote(num_cpus=0, max_concurrency=2 * HALL)(Hall)
    staff = [hall.remote(outcomes, seconds) for _ in range(halls)]
    # All are there before the watch is started.
    ready = [one.__ray_ready__.remote() for one in staff]
    ray.get(ready)
    with tempfile.TemporaryDirectory() as folder:
        actor = ray.remote(num_cpus=0, max_concurrency=2)(SearchActor)
        actor = actor.remote(search, str(Path(folder, "search")), None, lambda: SleepingMachines(staff))
        process = ray.get(actor.progress.remote()).process
        begin, spent = time.perf_counter(), processor_seconds(process)
        progress = ray.get(actor.run.remote())
        wall, spent = time.perf_counter() - begin, processor_seconds(process) - spent
        saved = Path(folder, "search").stat().st_size
    for one in (actor, *staff):
        ray.kill(one)
    assert progress.periods == workers * periods and not progress.messages, progress.messages
    return {
        "workers": workers,
        "seconds": wall,
        "efficiency": periods * seconds / wall,
        "outcomes_per_second": workers * periods / wall,
        "actor_ms_an_outcome": 1e3 * spent / (workers * periods),
        "file_bytes": saved,
    }


def traffic(lens: aplanat.Lens, plan: dict, period: int, machines: int = 1000) -> dict:
    """The messages and bytes of so many machines, from two real periods of a group."""
    search = cluster.Coordinator(lens, plan, 4 * period, 2, period)
    cluster_periods, took = [], []
    for i in (0, 1, 0):
        one = search.begin(i)
        begin = time.perf_counter()
        outcome = cluster.work(one)
        took.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        verdict = cluster.judge(one, outcome)
        judged = time.perf_counter() - begin
        search.accept(i, cluster.confirm(outcome, verdict))
        cluster_periods.append(one)
    seconds, lens_bytes = took[-1], len(outcome.lenses[0].encode())
    sent = len(pickle.dumps(cluster_periods[-1])) + SHARED * lens_bytes
    returned = len(pickle.dumps((outcome, verdict)))
    rate = machines / seconds
    return {
        "machines": machines,
        "gradients_a_period": period,
        "seconds_a_period": seconds,
        "seconds_a_judgement": judged,
        "bytes_sent_a_period": sent,
        "bytes_returned_a_period": returned,
        "bytes_of_lenses_a_period": SHARED * lens_bytes,
        "messages_per_second": 4 * rate,
        "megabytes_per_second": 1e-6 * rate * (sent + returned),
        "reservoir_megabytes_per_second": 1e-6 * rate * (SHARED + 1) * lens_bytes,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lens", default="cooke_triplet_100_f27", help="the name of a bundled lens")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 8, 64, 512])
    parser.add_argument("--seconds", type=float, help="of a period; absent: as long as a real one takes")
    parser.add_argument("--period", type=int, default=1000, help="gradients of a real period")
    parser.add_argument("--periods", type=int, default=3, help="periods of every worker")
    options = parser.parse_args()
    lens, plan = aplanat.Lens.bundled(options.lens), {"settings": {"seed": 1}}
    needs = traffic(lens, plan, options.period)
    seconds = options.seconds or needs["seconds_a_period"] + needs["seconds_a_judgement"]
    cluster.connect()
    rows = [simulate(lens, plan, count, seconds, options.periods) for count in options.workers]
    actor_ms = rows[-1]["actor_ms_an_outcome"]
    needs["actor_busy"] = 1e-3 * actor_ms * needs["machines"] / needs["seconds_a_period"]
    needs["seconds_a_period_for_an_actor_half_busy"] = 2e-3 * actor_ms * needs["machines"]
    print(json.dumps({"sleep": seconds, "simulated": rows, "traffic": needs}, indent=2))


if __name__ == "__main__":
    main()
