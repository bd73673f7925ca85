"""Which periods are being done: as many as are ready, those that fail again, slow ones a second time.

The same period has the same outcome everywhere, so that none of this changes the result.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import median
from typing import Any, Protocol

from .coordinator import Coordinator
from .periods import Outcome, Period

ATTEMPTS = 5
"""A period is tried so often before the search gives up."""
SLOW = 3.0
"""A period that takes so many times the usual one is begun a second time where a machine is free."""
LEAST = 10.0
"""A period of fewer seconds is never slow: a new worker takes seconds to start."""


class Machines(Protocol):
    """Where periods are done: the machines of Ray, or those of a test."""

    def begin(self, period: Period) -> Any:
        """Begins a period; returns what stands for its outcome."""

    def wait(self, begun: list[Any], seconds: float) -> list[Any]:
        """Those that have ended, as soon as there is one, or none after some seconds."""

    def outcome(self, begun: Any) -> Outcome:
        """The outcome of one that has ended, which was judged anew. Raises what went wrong."""

    def give_up(self, begun: Any) -> None:
        """Ends one whose outcome is not needed any more."""

    def free(self, busy: int) -> int:
        """How many more could be done at once, if so many are being done."""


class LostPeriodError(RuntimeError):
    """A period that failed on every machine."""


@dataclass
class Job:
    """A period that is being done."""

    group: int
    period: Period
    since: float
    begun: list[Any]
    failures: int = 0


@dataclass
class Schedule:
    """The periods of a search that are being done."""

    search: Coordinator
    machines: Machines
    messages: list[str] = field(default_factory=list)
    """What went wrong and was mended."""

    def __post_init__(self) -> None:
        self._jobs: dict[int, Job] = {}
        self._seconds: deque[float] = deque(maxlen=101)

    def step(self, seconds: float = 1.0) -> int:
        """Begins what can begin, and takes the outcomes that are there; waits so long for the first one.
        Returns the number of accepted periods."""
        for i in self.search.ready(self._jobs):
            period = self.search.begin(i)
            begun = [self.machines.begin(period)]
            self._jobs[i] = Job(i, period, time.monotonic(), begun)
        waiting = {begun: job for job in self._jobs.values() for begun in job.begun}
        ended = self.machines.wait(list(waiting), seconds)
        accepted = sum(self._take(waiting[begun], begun) for begun in ended)
        if not self.search.ready(self._jobs):
            self._begin_slow_ones_again()
        return accepted

    def _take(self, job: Job, begun: Any) -> bool:
        """Takes the outcome of a period. If it is none, the period is done again."""
        if self._jobs.get(job.group) is not job:
            return False  # The other one of two was first.
        job.begun.remove(begun)
        try:
            outcome = self.machines.outcome(begun)
        except Exception as error:  # whatever a machine does, another one tries again
            self._begin_again(job, error)
            return False
        self.search.accept(job.group, outcome)
        del self._jobs[job.group]
        self._seconds.append(time.monotonic() - job.since)
        self._give_up(job.begun)
        return True

    def _begin_again(self, job: Job, error: Exception) -> None:
        job.failures += 1
        if job.failures >= ATTEMPTS:
            raise LostPeriodError(f"group {job.group} failed {ATTEMPTS} times: {error}") from error
        self.messages.append(f"group {job.group} is done again: {error}")
        if not job.begun:
            job.since = time.monotonic()
            job.begun.append(self.machines.begin(job.period))

    def _begin_slow_ones_again(self) -> None:
        limit = max(LEAST, SLOW * median(self._seconds)) if self._seconds else float("inf")
        now = time.monotonic()
        slow = [j for j in self._jobs.values() if now - j.since > limit and len(j.begun) == 1]
        if not slow:
            return
        free = self.machines.free(sum(len(job.begun) for job in self._jobs.values()))
        for job in slow[: max(free, 0)]:
            self.messages.append(f"group {job.group} is slow, and is begun a second time")
            job.begun.append(self.machines.begin(job.period))

    def _give_up(self, begun: Iterable[Any]) -> None:
        for one in begun:
            self.machines.give_up(one)
