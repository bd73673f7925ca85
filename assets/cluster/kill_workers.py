"""Kills workers and the actor of a search at random, and compares its result with the undisturbed one.

    python assets/cluster/kill_workers.py --kills 20

Every kill is a SIGKILL of a process that this script has started: the actor, or a worker that is doing a
period. The undisturbed search runs in this process, without Ray.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import tempfile
import threading
import time
from pathlib import Path

import aplanat
from aplanat import ray as cluster

# Ray's workers would yield to every other process of the machine.
os.environ.setdefault("RAY_worker_niceness", "0")

ACTOR, WORKER = "ray::SearchActor", "ray::work_alone"


def parents() -> dict[int, int]:
    """The parent of every process."""
    found = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                status = (folder / "stat").read_text(encoding="utf-8", errors="replace")
                found[int(folder.name)] = int(status.rpartition(")")[2].split()[1])
            except OSError:
                pass  # It has ended meanwhile.
    return found


def own_processes(title: str) -> list[int]:
    """The processes with this title that descend from this one."""
    tree, found = parents(), []
    for process in tree:
        above = process
        while above and above != os.getpid():
            above = tree.get(above, 0)
        try:
            command = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if above and command.startswith(title):
            found.append(process)
    return found


class Killer(threading.Thread):
    """Kills so many processes, with random pauses in between."""

    def __init__(self, kills: int, seed: int, pause: tuple[float, float]) -> None:
        super().__init__(daemon=True)
        self.pause, self.wanted, self.killed = pause, kills, {ACTOR: 0, WORKER: 0}
        self.dice = random.Random(seed)

    def run(self) -> None:
        while sum(self.killed.values()) < self.wanted:
            time.sleep(self.dice.uniform(*self.pause))
            # One in three is the actor, and the first two are one of each.
            title = ACTOR if self.dice.random() < 1 / 3 else WORKER
            title = next((other for other, count in self.killed.items() if not count), title)
            processes = own_processes(title)
            if processes:
                os.kill(self.dice.choice(processes), signal.SIGKILL)
                self.killed[title] += 1


def run_disturbed(lens: aplanat.Lens, plan: dict, settings: dict, killer: Killer) -> cluster.Progress:
    """The search on two workers, some of which are killed."""
    with tempfile.TemporaryDirectory() as folder:
        killer.start()
        actors = set()
        for progress in cluster.search(
            lens, plan, checkpoint=Path(folder, "search"), machines=2, **settings
        ):
            actors.add(progress.process)
    print(f"{len(actors)} actors were seen; {'; '.join(progress.messages[-5:])}")
    return progress


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lens", default="singlet_la1131", help="the name of a bundled lens")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--gradients", type=int, default=60_000)
    parser.add_argument("--groups", type=int, default=3)
    parser.add_argument("--period", type=int, default=500)
    parser.add_argument("--pause", type=float, nargs=2, default=(0.5, 3.0), help="seconds")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    lens, plan = aplanat.Lens.bundled(options.lens), {"settings": {"seed": options.seed}}
    settings = {name: getattr(options, name) for name in ("gradients", "groups", "period")}
    begin = time.perf_counter()
    *_, undisturbed = cluster.run_here(cluster.Coordinator(lens, plan, **settings))
    alone = time.perf_counter() - begin
    killer = Killer(options.kills, options.seed, tuple(options.pause))
    begin = time.perf_counter()
    disturbed = run_disturbed(lens, plan, settings, killer)
    result = {
        "killed_workers": killer.killed[WORKER],
        "killed_actors": killer.killed[ACTOR],
        "seconds_alone": alone,
        "seconds_disturbed": time.perf_counter() - begin,
        "periods": disturbed.periods,
        "same_bits": disturbed.fingerprint == undisturbed.fingerprint,
        "fingerprint": disturbed.fingerprint,
    }
    print(json.dumps(result, indent=2))
    if sum(killer.killed.values()) < options.kills:
        raise SystemExit("the search ended before the last kill; expected more --gradients")
    if not result["same_bits"]:
        raise SystemExit("the result is another one")


if __name__ == "__main__":
    main()
