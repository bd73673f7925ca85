"""One search on many machines, by Ray.

The search is split into groups of chains, each a run of its own with its own seed. Every group works for
as many gradients as a period has, on whatever machine is free; then each is given the best lenses of all
the others, in the order of the groups, and judges them anew. A group's state is a checkpoint, so a period
that a machine loses is done again from where it began. The result depends on the seed and on the number
of groups, not on the number of machines, nor on which of them failed.

    python -m aplanat.ray search lens.json --out best.json --groups 8 --gradients 96000

Without `--address` a cluster is started on this machine.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from . import _aplanat
from .commands import run
from .lens import Lens
from .results import Result, from_json
from .runs import GrinTask, Search

VERSION = _aplanat.__version__
ATTEMPTS = 5
"""A period is tried so often before the search gives up."""


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
    gradients: int
    """The gradients that it has taken so far."""
    version: str = VERSION


class LostPeriodError(RuntimeError):
    """A period that failed on every machine."""


def work(period: Period) -> Outcome:
    """Does the work of a period. The same period has the same outcome on every machine."""
    if period.version != VERSION:
        raise _aplanat.InputError(
            f"the search is of Aplanat {period.version}, this machine has {VERSION}; install the same"
        )
    with tempfile.TemporaryDirectory(prefix="aplanat-") as folder:
        path = Path(folder) / "state.json"
        search = _load(period.lens, period.plan, period.state, path)
        search.admit(_lens(text) for text in period.received)
        gradients = 0
        for progress in search:
            gradients = progress.statistics["gradients"]
        search.save(path)
        found = sorted(search.reservoir, key=lambda entry: entry[0])
        merits, lenses = zip(*found, strict=True)
        texts = tuple(lens._native.to_json() for lens in lenses)
        return Outcome(path.read_bytes(), merits, texts, gradients)


def _lens(text: str) -> Lens:
    return Lens(_aplanat.Lens.from_json(text))


def _load(lens: str, plan: str, state: bytes | None, path: Path) -> Search:
    if state is not None:
        path.write_bytes(state)
    checkpoint = None if state is None else path
    return Search(_lens(lens), json.loads(plan), checkpoint=checkpoint)


@dataclass
class Group:
    """A group of chains between two periods."""

    seed: int
    state: bytes | None = None
    merits: tuple[float, ...] = ()
    lenses: tuple[str, ...] = ()
    gradients: int = 0


@dataclass
class Coordinator:
    """The state of a whole search: what an actor of Ray holds, and a test without Ray."""

    lens: Lens
    plan: Mapping[str, Any]
    gradients: int
    groups: int = 2
    period: int = 1000
    _groups: list[Group] = field(default_factory=list)
    _done: int = 0

    def __post_init__(self) -> None:
        for name in ("gradients", "groups", "period"):
            if getattr(self, name) < 1:
                raise _aplanat.InputError(f"{name}: found {getattr(self, name)}; expected 1 or more")
        seed = int(self.plan.get("settings", {}).get("seed", 1))
        self._text = self.lens._native.to_json()
        self._groups = [Group(seed * 1_000_003 + i) for i in range(self.groups)]
        # A wrong plan is refused before any machine is asked.
        Search(self.lens, json.loads(self._plan(self._groups[0], 1)))

    def _plan(self, group: Group, gradients: int) -> str:
        settings = {**self.plan.get("settings", {}), "seed": group.seed, "gradients": gradients}
        return json.dumps({**self.plan, "settings": settings})

    @property
    def is_finished(self) -> bool:
        """True once all gradients are taken."""
        return self._done * self.period >= self._share

    @property
    def _share(self) -> int:
        return -(-self.gradients // self.groups)

    def periods(self) -> list[Period]:
        """The next period of every group."""
        goal = min((self._done + 1) * self.period, self._share)
        best = [group.lenses[:1] for group in self._groups]
        return [
            Period(
                self._text,
                self._plan(group, goal),
                group.state,
                tuple(lens for j, found in enumerate(best) if j != i for lens in found),
            )
            for i, group in enumerate(self._groups)
        ]

    def accept(self, periods: list[Period], outcomes: list[Outcome]) -> None:
        """Takes the outcomes of all groups, each of which was checked by `check`."""
        for group, outcome in zip(self._groups, outcomes, strict=True):
            group.state, group.gradients = outcome.state, outcome.gradients
            group.merits, group.lenses = outcome.merits, outcome.lenses
        self._done += 1

    @property
    def best(self) -> tuple[float, Lens]:
        """The best merit and its lens so far."""
        merit, _, text = min(
            (group.merits[0], i, group.lenses[0])
            for i, group in enumerate(self._groups)
            if group.merits
        )
        lens = _lens(text)
        data = {**lens.data, "name": self.lens.data["name"]}
        return merit, Lens(data)

    @property
    def taken(self) -> int:
        """The gradients taken so far."""
        return sum(group.gradients for group in self._groups)

    @property
    def fingerprint(self) -> str:
        """A hash of the states of all groups, to compare runs with."""
        states = b"".join(group.state or b"" for group in self._groups)
        return hashlib.sha256(states).hexdigest()

    @property
    def best_state(self) -> bytes:
        """The checkpoint of the group with the best lens, which the studio opens."""
        best = min(self._groups, key=lambda group: group.merits[:1] or (float("inf"),))
        return best.state or b""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Saves the whole search."""
        groups = [
            {**vars(group), "state": (group.state or b"").decode()} for group in self._groups
        ]
        content = {
            "aplanat_ray_search": 1,
            "lens": self.lens.data,
            "plan": dict(self.plan),
            "gradients": self.gradients,
            "period": self.period,
            "done": self._done,
            "groups": groups,
        }
        _write_whole(Path(path), json.dumps(content).encode())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Coordinator:
        """The search of a file."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            groups = content["groups"]
            loaded = cls(
                Lens(content["lens"]),
                content["plan"],
                content["gradients"],
                len(groups),
                content["period"],
            )
            loaded._done = content["done"]
            for group, stored in zip(loaded._groups, groups, strict=True):
                group.state = stored["state"].encode() or None
                group.merits, group.lenses = tuple(stored["merits"]), tuple(stored["lenses"])
                group.gradients = stored["gradients"]
        except (KeyError, TypeError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise _aplanat.InputError(f"{path}: not a search of aplanat.ray: {error!r}") from None
        return loaded


def check(period: Period, outcome: Any) -> Outcome:
    """The outcome of a machine, if it is one of this period: its state is loaded and its best lens
    judged anew, so that nothing is believed.

    Raises `InputError` for garbage, another lens, another version, or a merit that is not confirmed.
    """
    if not isinstance(outcome, Outcome):
        raise _aplanat.InputError(f"a machine returned {type(outcome).__name__}; expected an outcome")
    if outcome.version != VERSION:
        raise _aplanat.InputError(f"a machine has Aplanat {outcome.version}; expected {VERSION}")
    with tempfile.TemporaryDirectory(prefix="aplanat-") as folder:
        path = Path(folder) / "state.json"
        search = _load(period.lens, period.plan, outcome.state, path)
    # Loading has judged the reservoir anew: its numbers take the place of those that were sent.
    found = sorted(search.reservoir, key=lambda entry: entry[0])
    merits, lenses = zip(*found, strict=True)
    texts = tuple(lens._native.to_json() for lens in lenses)
    if (merits, texts) != (tuple(outcome.merits), tuple(outcome.lenses)):
        raise _aplanat.InputError("a machine returned merits that its own checkpoint does not have")
    return replace(outcome, merits=merits, lenses=texts)


def run_here(coordinator: Coordinator) -> Iterator[Coordinator]:
    """Runs a search in this process, without Ray; yields after every exchange."""
    while not coordinator.is_finished:
        periods = coordinator.periods()
        coordinator.accept(periods, [work(period) for period in periods])
        yield coordinator


def search(
    lens: Lens,
    plan: Mapping[str, Any] | None = None,
    *,
    gradients: int = 12_000,
    groups: int = 2,
    period: int = 1000,
    coordinator: Coordinator | None = None,
) -> Iterator[Coordinator]:
    """Runs a search on the machines of Ray; yields its state after every exchange.

    `plan` is that of `aplanat.Search`. `gradients` are those of all groups together, `period` those of a
    group between two exchanges. Break off the loop to stop.
    """
    import ray

    if not ray.is_initialized():
        ray.init(log_to_driver=False, include_dashboard=False)
    remote = ray.remote(num_cpus=1, max_retries=-1, retry_exceptions=False)(_work_alone)
    state = coordinator or Coordinator(lens, plan or {}, gradients, groups, period)
    while not state.is_finished:
        periods = state.periods()
        state.accept(periods, _run_periods(periods, remote.remote, ray))
        yield state


def _work_alone(period: Period) -> Outcome:
    """The work of a task on one core: the chains of other groups have the others."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return work(period)


def _run_periods(periods: list[Period], submit: Callable[[Period], Any], ray: Any) -> list[Outcome]:
    """The outcomes of periods. A period that fails or returns something else is done again."""
    outcomes: dict[int, Outcome] = {}
    attempts = dict.fromkeys(range(len(periods)), 0)
    waiting = {submit(period): i for i, period in enumerate(periods)}
    while waiting:
        [done], _ = ray.wait(list(waiting), num_returns=1)
        i = waiting.pop(done)
        try:
            outcomes[i] = check(periods[i], ray.get(done))
        except Exception as error:  # whatever a machine does, another one tries again
            attempts[i] += 1
            if attempts[i] >= ATTEMPTS:
                raise LostPeriodError(f"group {i} failed {ATTEMPTS} times: {error}") from error
            waiting[submit(periods[i])] = i
    return [outcomes[i] for i in range(len(periods))]


def each(function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> list[Any]:
    """The results of a function for each of some arguments, on the machines of Ray, in their order. Work
    that a lost machine was doing is done again."""
    import ray

    if not ray.is_initialized():
        ray.init(log_to_driver=False, include_dashboard=False)
    remote = ray.remote(num_cpus=1, max_retries=-1)(_call_alone)
    return ray.get([remote.remote(function, *words) for words in arguments])


def _call_alone(function: Callable[..., Any], *arguments: Any) -> Any:
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return function(*arguments)


def commands(lines: Iterable[Sequence[object]]) -> list[Result]:
    """The results of commands of the command line, such as `("experiment", "4.6")`, one a machine."""
    return each(_command, [([str(word) for word in line],) for line in lines])


def _command(words: list[str]) -> Result:
    return run(*words)


def pareto(
    lens: Lens, *, points: int = 20, slices: int = 2, **settings: Any
) -> list[tuple[Result, Lens]]:
    """The front of sharpness against light, a slice of the weights a machine, in the order of the light.

    The settings are those of `aplanat.pareto`.
    """
    if not 1 <= slices <= points:
        raise _aplanat.InputError(f"slices: found {slices}; expected 1 to the number of points")
    low, high = settings.pop("blur", (4e-5, 3.5e-3))
    edges = [low * (high / low) ** (i / slices) for i in range(slices + 1)]
    shares = [points // slices + (i < points % slices) for i in range(slices)]
    text = lens._native.to_json()
    tasks = [
        (text, {**settings, "points": share, "blur": edges[i : i + 2]})
        for i, share in enumerate(shares)
    ]
    found = [
        (from_json(json.loads(numbers)), _lens(lens))
        for front in each(_front, tasks)
        for numbers, lens in front
    ]
    return [one for one in sorted(found, key=_light) if not any(_beats(two, one) for two in found)]


def _front(lens: str, settings: dict[str, Any]) -> list[tuple[str, str]]:
    sweep = _aplanat.ParetoSweep(_aplanat.Lens.from_json(lens), json.dumps(settings))
    while not json.loads(sweep.step())["finished"]:
        pass
    numbers, lenses = sweep.front()
    return [(json.dumps(n), lens.to_json()) for n, lens in zip(json.loads(numbers), lenses, strict=True)]


def _light(entry: tuple[Result, Lens]) -> float:
    return entry[0].light


def _beats(two: tuple[Result, Lens], one: tuple[Result, Lens]) -> bool:
    (a, _), (b, _) = two, one
    return a.spot <= b.spot and a.light >= b.light and (a.spot < b.spot or a.light > b.light)


def grin(tasks: Iterable[str | Mapping[str, Any]], nodes: int = 65) -> list[tuple[Any, Any, Any]]:
    """The fields of tasks of refractive index, a task a machine: what `aplanat.GrinTask.field` gives."""
    return each(_field, [(task, nodes) for task in tasks])


def _field(task: str | Mapping[str, Any], nodes: int) -> tuple[Any, Any, Any]:
    design = GrinTask(task)
    for _ in design:
        pass
    return design.field(nodes)


def _write_whole(path: Path, content: bytes) -> None:
    """Writes a file so that it is there whole or not at all."""
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(content)
    os.replace(partial, path)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m aplanat.ray", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    search = commands.add_parser("search", help="optimizes the structure of a lens")
    search.add_argument("lens", help="the lens: .json, .zmx, .zar, .seq, .len or .roa")
    search.add_argument("--out", required=True, help="the file for the best lens: .json or .zmx")
    search.add_argument("--gradients", type=int, default=12_000, help="gradients of all groups")
    search.add_argument("--groups", type=int, default=2, help="groups of chains, at least one a core")
    search.add_argument("--period", type=int, default=1000, help="gradients between two exchanges")
    search.add_argument("--seed", type=int, default=1, help="the seed of all random numbers")
    search.add_argument("--plan", help="the plan as JSON: goal, rules, local, settings")
    search.add_argument("--checkpoint", help="saves the search here; goes on from it if it exists")
    search.add_argument("--watch", help="saves the best group here, for the studio")
    search.add_argument("--address", help="the cluster of Ray; absent: one on this machine")
    return parser


def _main() -> int:
    options = _arguments().parse_args()
    try:
        import ray
    except ImportError:
        print("error: Ray is not installed; expected `pip install 'aplanat[ray]'`", file=sys.stderr)
        return 2
    try:
        lens = Lens.open(options.lens)
        plan = json.loads(Path(options.plan).read_text(encoding="utf-8")) if options.plan else {}
        plan.setdefault("settings", {})["seed"] = options.seed
        ray.init(address=options.address, log_to_driver=False, include_dashboard=False)
        resumes = options.checkpoint and Path(options.checkpoint).exists()
        state = (
            Coordinator.load(options.checkpoint)
            if resumes
            else Coordinator(lens, plan, options.gradients, options.groups, options.period)
        )
        for state in search(lens, coordinator=state):
            merit, best = state.best
            print(f"{state.taken} gradients, merit {merit:.6g}", file=sys.stderr)
            best.save(options.out)
            if options.checkpoint:
                state.save(options.checkpoint)
            if options.watch:
                _write_whole(Path(options.watch), state.best_state)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (LostPeriodError, _aplanat.WorkError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    merit, _ = state.best
    print(json.dumps({"merit": merit, "gradients": state.taken, "fingerprint": state.fingerprint}))
    return 0


if __name__ == "__main__":
    sys.exit(_main())
