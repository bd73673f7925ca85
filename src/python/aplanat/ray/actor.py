"""The search as an actor of Ray: it holds the groups, hands their periods to the machines, and saves.

If the actor is lost, Ray starts it anew, and it goes on from its file. What was not saved is done again,
with the same outcome.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..lens import Lens
from . import store
from .coordinator import Coordinator
from .periods import Outcome, Period, Verdict, confirm, judge, parse_lens, work
from .schedule import Machines, Schedule

POLL = 0.2  # seconds between two looks of the driver
SAVING = 0.05
"""The part of the time that saving takes at most."""
REMEMBERED = 20
"""The number of messages that a search remembers."""


@dataclass(frozen=True)
class Progress:
    """The state of a search as its driver sees it."""

    periods: int
    """The periods that are done, of all groups together."""
    gradients: int
    """The gradients taken so far."""
    statistics: Mapping[str, int]
    """The counters of all groups together."""
    found: tuple[tuple[float, str], ...]
    """The best merits of the best groups, the best first, with their lenses as JSON."""
    name: str
    """The name of the lens."""
    fingerprint: str
    """A hash of the states of all groups, to compare finished runs with."""
    messages: tuple[str, ...]
    """What went wrong and was mended, the last one last."""
    seconds: float
    """The time since the actor was started for the last time."""
    process: int
    """The process of the actor."""

    @property
    def best(self) -> tuple[float, Lens]:
        """The best merit and its lens so far."""
        merit, text = self.found[0]
        return merit, Lens({**parse_lens(text).data, "name": self.name})


class SearchActor:
    """A search whose periods are done by the machines of Ray."""

    def __init__(
        self,
        search: Coordinator,
        checkpoint: str | None,
        watch: str | None,
        machines: Callable[[], Machines],
    ) -> None:
        self._checkpoint, self._watch = checkpoint, watch
        self._search = store.resume(search, checkpoint)
        self._schedule = Schedule(self._search, machines())
        self._lock = threading.Lock()
        self._since = self._saved_at = time.monotonic()
        self._save_seconds = 0.0
        self._is_failing = False
        self._progress = self._look()

    def run(self) -> Progress:
        """Runs the search to its end."""
        while not self._search.is_finished:
            if self._schedule.step():
                self._save_at_times()
                self._publish_at_times()
        self._save()
        self._publish()
        return self._progress

    def progress(self) -> Progress:
        """The state of the search, at any time."""
        with self._lock:
            return self._progress

    def _publish_at_times(self) -> None:
        """Publishes the state if the last time is as long ago as the driver waits."""
        if time.monotonic() - self._since - self._progress.seconds >= POLL / 2:
            self._publish()

    def _publish(self) -> None:
        progress = self._look()
        with self._lock:
            self._progress = progress

    def _look(self) -> Progress:
        search = self._search
        return Progress(
            search.accepted,
            search.taken,
            dict(search.statistics),
            tuple(search.found),
            search.lens.data["name"],
            search.fingerprint,
            tuple(self._schedule.messages[-REMEMBERED:]),
            time.monotonic() - self._since,
            os.getpid(),
        )

    def _save_at_times(self) -> None:
        """Saves if the last time is so long ago that saving takes a small part of the time."""
        if (time.monotonic() - self._saved_at) * SAVING >= self._save_seconds:
            self._save()

    def _save(self) -> None:
        """Saves the search. A disk that is full is said once, and the search goes on."""
        began = time.monotonic()
        try:
            if self._checkpoint:
                store.save(self._search, self._checkpoint)
            if self._watch and self._search.best_state:
                write_whole(Path(self._watch), self._search.best_state)
            self._is_failing = False
        except OSError as error:
            if not self._is_failing:
                message = f"the search goes on, but is not saved: {error}"
                self._schedule.messages.append(message)
            self._is_failing = True
        self._saved_at = time.monotonic()
        self._save_seconds = self._saved_at - began


class RayMachines:
    """The machines of Ray, a core for each period.

    Another task judges each outcome: the actor alone would not keep up with many machines. It only
    compares what the two have found.
    """

    def __init__(self) -> None:
        import ray

        self._ray = ray
        # What a lost machine was doing is begun again by Ray itself.
        options = {"max_retries": -1, "retry_exceptions": False, "scheduling_strategy": "SPREAD"}
        self._work = ray.remote(num_cpus=1, **options)(work_alone)
        self._judge = ray.remote(num_cpus=1, **options)(judge_alone)
        self._outcomes: dict[Any, Any] = {}

    def begin(self, period: Period) -> Any:
        """Begins a period; what stands for it is the verdict about its outcome."""
        shared = self._ray.put(period)
        outcome = self._work.remote(shared)
        return self._expect(outcome, self._judge.remote(shared, outcome))

    def _expect(self, outcome: Any, verdict: Any) -> Any:
        self._outcomes[verdict] = outcome
        return verdict

    def wait(self, begun: list[Any], seconds: float) -> list[Any]:
        """Those that have ended."""
        first, _ = self._ray.wait(begun, num_returns=1, timeout=seconds)
        if not first:
            return []
        ended, _ = self._ray.wait(begun, num_returns=len(begun), timeout=0)
        return ended

    def outcome(self, begun: Any) -> Outcome:
        """The outcome of one that has ended."""
        outcome, verdict = self._ray.get([self._outcomes.pop(begun), begun])
        return confirm(outcome, verdict)

    def give_up(self, begun: Any) -> None:
        """Ends one whose outcome is not needed any more."""
        for one in (self._outcomes.pop(begun), begun):
            self._ray.cancel(one, force=True)

    def free(self, busy: int) -> int:
        """The cores that have nothing to do."""
        return int(self._ray.cluster_resources().get("CPU", 0)) - busy


def work_alone(period: Period) -> Outcome:
    """The work of a task on one core: other periods have the others."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return work(period)


def judge_alone(period: Period, outcome: Outcome) -> Verdict:
    """The judgement of an outcome on one core."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return judge(period, outcome)


def connect(machines: str | int | None = None) -> Any:
    """Ray, connected with the cluster of an address, or with so many cores of this machine; absent: with
    what it is connected with, with the cluster of `RAY_ADDRESS`, or with all cores of this machine."""
    import ray

    if not ray.is_initialized():
        cores = machines if isinstance(machines, int) else None
        address = None if cores else machines or os.environ.get("RAY_ADDRESS")
        # Ray itself would join any cluster that was ever started on this machine.
        here = address is None
        ray.init(
            address="local" if here else address,
            num_cpus=cores,
            include_dashboard=False if here else None,
            log_to_driver=False,
        )
    return ray


def search(
    lens: Lens,
    plan: Mapping[str, Any] | None = None,
    *,
    gradients: int = 12_000,
    groups: int = 2,
    period: int = 1000,
    checkpoint: str | os.PathLike[str] | None = None,
    watch: str | os.PathLike[str] | None = None,
    machines: str | int | None = None,
) -> Iterator[Progress]:
    """Runs a search on the machines of Ray; yields its progress. Break off the loop to stop.

    `plan` is that of `aplanat.Search`. `gradients` are those of all groups together, `period` those of a
    group between two exchanges. The search is saved in the file `checkpoint`, and goes on from it if it
    exists; in the file `watch` is the best group, for the studio. `machines` is the address of a cluster
    of Ray or a number of cores of this machine.
    """
    # What is wrong is refused here, and not by an actor far away.
    whole = Coordinator(lens, plan or {}, gradients, groups, period)
    store.resume(whole, checkpoint)
    with tempfile.TemporaryDirectory(prefix="aplanat-") as folder:
        path = Path(folder, "search") if checkpoint is None else Path(checkpoint).absolute()
        watched = None if watch is None else str(Path(watch).absolute())
        yield from _watch(connect(machines), whole, str(path), watched)


def _watch(ray: Any, search: Coordinator, path: str, watched: str | None) -> Iterator[Progress]:
    """Starts the actor and yields its progress; ends it when the loop is broken off."""
    here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
        ray.get_runtime_context().get_node_id(), soft=True
    )
    options = {"max_restarts": -1, "max_task_retries": -1, "max_concurrency": 2, "num_cpus": 0}
    actor = ray.remote(**options)(SearchActor)
    actor = actor.options(scheduling_strategy=here).remote(search, path, watched, RayMachines)
    try:
        running, seen = actor.run.remote(), None
        while not ray.wait([running], timeout=POLL)[0]:
            progress = ray.get(actor.progress.remote())
            if progress.found and (progress.process, progress.periods) != seen:
                yield progress
            seen = progress.process, progress.periods
        yield ray.get(running)
    except ray.exceptions.RayTaskError as error:
        raise (error.cause or error) from None
    finally:
        ray.kill(actor)


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file so that it is there whole or not at all."""
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(content)
    os.replace(partial, path)
