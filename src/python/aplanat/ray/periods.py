"""The unit of work of a search on many machines: what a group of chains does between two exchanges."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import _aplanat
from ..lens import Lens
from ..runs import Search

VERSION = _aplanat.__version__
MEMORY = Path("/dev/shm")
"""A folder in memory, where the system has one: a full disk of a machine is no reason to fail."""


@dataclass(frozen=True)
class Period:
    """The work of a group until the next exchange."""

    lens: str
    """The lens of the search, as JSON."""
    plan: str
    """The plan of the group, as JSON, with the gradients at which the period ends."""
    state: bytes | None
    """The checkpoint of the group; none before its first period."""
    received: tuple[str, ...]
    """The lenses of the other groups, as JSON."""
    version: str = VERSION


@dataclass(frozen=True)
class Outcome:
    """The state of a group after a period."""

    state: bytes
    """Its checkpoint."""
    merits: tuple[float, ...]
    """The merits of its reservoir, the best first."""
    lenses: tuple[str, ...]
    """The lenses of its reservoir, as JSON, the best first."""
    statistics: Mapping[str, int]
    """Its counters so far, among them its gradients."""
    version: str = VERSION


def work(period: Period) -> Outcome:
    """Does the work of a period. The same period has the same outcome on every machine."""
    if period.version != VERSION:
        raise _aplanat.InputError(
            f"the search is of Aplanat {period.version}, this machine has {VERSION}; install the same"
        )
    with _scratch() as folder:
        path = Path(folder) / "state.json"
        search = _load(period, period.state, path)
        search.admit(parse_lens(text) for text in period.received)
        for progress in search:
            counters = progress.statistics
        search.save(path)
        counted = {name: count for name, count in counters.items() if isinstance(count, int)}
        return Outcome(path.read_bytes(), *_reservoir(search), counted)


@dataclass(frozen=True)
class Verdict:
    """What a machine finds that judges the outcome of another one."""

    digest: bytes
    """A hash of the checkpoint."""
    merits: tuple[float, ...]
    """The merits of its reservoir, computed anew, the best first."""
    lenses: tuple[str, ...]
    """The lenses of its reservoir, as JSON, the best first."""


def judge(period: Period, outcome: Any) -> Verdict:
    """Judges the outcome of a period anew: loads its checkpoint and computes its merits.

    Raises `InputError` for garbage, another lens or another version.
    """
    check_form(outcome)
    with _scratch() as folder:
        search = _load(period, outcome.state, Path(folder) / "state.json")
    return Verdict(hashlib.sha256(outcome.state).digest(), *_reservoir(search))


def check_form(outcome: Any) -> None:
    """Refuses what is no outcome of this version."""
    if not isinstance(outcome, Outcome):
        raise _aplanat.InputError(f"a machine returned {type(outcome).__name__}; expected an outcome")
    if outcome.version != VERSION:
        raise _aplanat.InputError(f"a machine has Aplanat {outcome.version}; expected {VERSION}")


def confirm(outcome: Any, verdict: Any) -> Outcome:
    """The outcome, if the verdict is one about it and finds the same merits and lenses.

    Raises `InputError` if one of the two machines is wrong.
    """
    check_form(outcome)
    if not isinstance(verdict, Verdict) or verdict.digest != hashlib.sha256(outcome.state).digest():
        raise _aplanat.InputError("a machine has judged something else than an outcome")
    if (verdict.merits, verdict.lenses) != (tuple(outcome.merits), tuple(outcome.lenses)):
        raise _aplanat.InputError("a machine returned merits that its own checkpoint does not have")
    return outcome


def check(period: Period, outcome: Any) -> Outcome:
    """The outcome of a machine, if it is one of this period: nothing of it is believed."""
    return confirm(outcome, judge(period, outcome))


def parse_lens(text: str) -> Lens:
    """The lens of a JSON text."""
    return Lens(_aplanat.Lens.from_json(text))


def _scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder for the files of a period."""
    place = MEMORY if os.access(MEMORY, os.W_OK) else None
    return tempfile.TemporaryDirectory(prefix="aplanat-", dir=place)


def _load(period: Period, state: bytes | None, path: Path) -> Search:
    if state is not None:
        path.write_bytes(state)
    checkpoint = None if state is None else path
    return Search(parse_lens(period.lens), json.loads(period.plan), checkpoint=checkpoint)


def _reservoir(search: Search) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """The merits of a reservoir, the best first, and its lenses as JSON."""
    found = sorted(search.reservoir, key=lambda entry: entry[0])
    return tuple(merit for merit, _ in found), tuple(lens._native.to_json() for _, lens in found)
