"""The state of a search on many machines, without any machine.

A group begins a period with the best lenses that the others had one period before its last one. So a
group may be a period ahead of the slowest one, and what it is given does not depend on who was first.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from .. import _aplanat
from ..lens import Lens
from ..runs import Search
from .periods import Outcome, Period, parse_lens, work

LAG = 1
"""A group may be so many periods ahead of the slowest one before it waits."""
SHARED = 8
"""A group is given so many lenses at most: with many groups, those of the best ones."""


@dataclass
class Group:
    """A group of chains between two periods."""

    seed: int
    done: int = 0
    """The periods that it has done."""
    state: bytes | None = None
    """Its checkpoint."""
    digest: bytes = b""
    """A hash of the checkpoint."""
    merits: tuple[float, ...] = ()
    lenses: tuple[str, ...] = ()
    statistics: Mapping[str, int] = field(default_factory=dict)
    best: dict[int, tuple[float, str]] = field(default_factory=dict)
    """Its best merit and lens by the number of periods after which it had them."""


@dataclass
class Coordinator:
    """A search, split into groups of chains. The caller does the work of the periods."""

    lens: Lens
    plan: Mapping[str, Any]
    gradients: int
    """The gradients of all groups together."""
    groups: int = 2
    period: int = 1000
    """The gradients of a group between two exchanges."""

    def __post_init__(self) -> None:
        for name in ("gradients", "groups", "period"):
            if getattr(self, name) < 1:
                raise _aplanat.InputError(f"{name}: found {getattr(self, name)}; expected 1 or more")
        seed = int(self.plan.get("settings", {}).get("seed", 1))
        self._text = self.lens._native.to_json()
        self._groups = [Group(seed * 1_000_003 + i) for i in range(self.groups)]
        self.unsaved: set[int] = set(range(self.groups))
        """The groups that have changed since the search was saved."""
        # A wrong plan is refused before any machine is asked.
        Search(self.lens, json.loads(self._plan(self._groups[0], 1)))

    def _plan(self, group: Group, gradients: int) -> str:
        settings = {**self.plan.get("settings", {}), "seed": group.seed, "gradients": gradients}
        return json.dumps({**self.plan, "settings": settings})

    @property
    def _share(self) -> int:
        return -(-self.gradients // self.groups)

    @property
    def periods(self) -> int:
        """The periods of a group."""
        return -(-self._share // self.period)

    @property
    def done(self) -> int:
        """The periods that every group has done."""
        return min(group.done for group in self._groups)

    @property
    def accepted(self) -> int:
        """The periods that were done, of all groups together."""
        return sum(group.done for group in self._groups)

    @property
    def is_finished(self) -> bool:
        """True once all groups have taken their gradients."""
        return self.done >= self.periods

    def ready(self, running: Collection[int] = ()) -> list[int]:
        """The groups that can begin a period, apart from those that are running."""
        last = min(self.periods - 1, self.done + LAG)
        groups = enumerate(self._groups)
        return [i for i, group in groups if group.done <= last and i not in running]

    def begin(self, i: int) -> Period:
        """The next period of a group."""
        group = self._groups[i]
        goal = min((group.done + 1) * self.period, self._share)
        received = self._received(i, group.done - LAG)
        return Period(self._text, self._plan(group, goal), group.state, received)

    def _received(self, i: int, done: int) -> tuple[str, ...]:
        """The best lenses of the other groups after so many periods, in the order of their merits."""
        if done < 1:
            return ()
        others = ((*group.best[done], j) for j, group in enumerate(self._groups) if j != i)
        best = sorted((merit, j, lens) for merit, lens, j in others)
        return tuple(lens for _, _, lens in best[:SHARED])

    def accept(self, i: int, outcome: Outcome) -> None:
        """Takes the outcome of the next period of a group, which was checked by `check`."""
        group = self._groups[i]
        group.done += 1
        group.state, group.digest = outcome.state, hashlib.sha256(outcome.state).digest()
        group.merits, group.lenses = outcome.merits, outcome.lenses
        group.statistics = outcome.statistics
        group.best[group.done] = (outcome.merits[0], outcome.lenses[0])
        needed = self.done - LAG
        for older in [number for number in group.best if number < needed]:
            del group.best[older]
        self.unsaved.add(i)

    def _ranked(self) -> list[Group]:
        """The groups that have lenses, the best first."""
        begun = [group for group in self._groups if group.merits]
        return sorted(begun, key=lambda group: group.merits[0])

    @property
    def found(self) -> list[tuple[float, str]]:
        """The best merits and lenses of the best groups, the best first, the lenses as JSON."""
        return [(group.merits[0], group.lenses[0]) for group in self._ranked()[:SHARED]]

    @property
    def best(self) -> tuple[float, Lens]:
        """The best merit and its lens so far, with the name of that which it began with."""
        merit, text = self.found[0]
        return merit, Lens({**parse_lens(text).data, "name": self.lens.data["name"]})

    @property
    def statistics(self) -> Counter[str]:
        """The counters of all groups together."""
        return sum((Counter(group.statistics) for group in self._groups), Counter())

    @property
    def taken(self) -> int:
        """The gradients taken so far."""
        return self.statistics["gradients"]

    @property
    def fingerprint(self) -> str:
        """A hash of the states of all groups, to compare finished runs with."""
        digests = b"".join(group.digest for group in self._groups)
        return hashlib.sha256(digests).hexdigest()

    @property
    def best_state(self) -> bytes:
        """The checkpoint of the group with the best lens, which the studio opens: its reservoir, its
        family and its statistics."""
        return next((group.state or b"" for group in self._ranked()), b"")


def run_here(coordinator: Coordinator) -> Iterator[Coordinator]:
    """Runs a search in this process, without Ray; yields after every period of all groups."""
    while not coordinator.is_finished:
        for i in coordinator.ready():
            coordinator.accept(i, work(coordinator.begin(i)))
        yield coordinator
