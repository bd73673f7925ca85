"""Work that needs no exchange: commands, studies with a seed each, slices of a front, fields of index.

Each piece goes to whatever machine is free; what a lost machine was doing is done again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from .. import _aplanat
from ..commands import run
from ..lens import Lens
from ..results import Result, from_json
from ..runs import GrinTask
from .actor import connect
from .periods import VERSION, parse_lens

SEED = "{seed}"
"""Stands for the seed in the words of a study."""


def each(function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> list[Any]:
    """The results of a function for each of some arguments, on the machines of Ray, in their order."""
    ray = connect()
    remote = ray.remote(num_cpus=1, max_retries=-1, scheduling_strategy="SPREAD")(_call_alone)
    try:
        return ray.get([remote.remote(VERSION, function, *words) for words in arguments])
    except ray.exceptions.RayTaskError as error:
        # The errors of the library, as it raises them here.
        raise (error.cause or error) from None


def _call_alone(version: str, function: Callable[..., Any], *arguments: Any) -> Any:
    if version != VERSION:
        raise _aplanat.InputError(
            f"the work is of Aplanat {version}, this machine has {VERSION}; install the same"
        )
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return function(*arguments)


def commands(lines: Iterable[Sequence[object]]) -> list[Result]:
    """The results of commands of the command line, such as `("experiment", "4.6")`, one a machine."""
    return each(_command, [([_word(word) for word in line],) for line in lines])


def studies(line: Sequence[object], seeds: Iterable[int]) -> list[Result]:
    """The results of a command for each of some seeds, which take the place of `{seed}` in its words;
    without it `--seed` is added.

    >>> studies(("tolerance", lens, "--samples", 500), range(8))
    """
    words = [_word(word) for word in line]
    if not any(SEED in word for word in words if isinstance(word, str)):
        words += ["--seed", SEED]
    return commands([_with_seed(words, seed) for seed in seeds])


def _with_seed(words: list[str | Lens], seed: int) -> list[str | Lens]:
    filled = (word.replace(SEED, str(seed)) if isinstance(word, str) else word for word in words)
    return list(filled)


def _word(word: object) -> str | Lens:
    return word if isinstance(word, Lens) else str(word)


def _command(words: list[str | Lens]) -> Result:
    return run(*words)


def pareto(
    lens: Lens, *, points: int = 20, slices: int = 2, **settings: Any
) -> list[tuple[Result, Lens]]:
    """The front of sharpness against light, in the order of the light. Its levels of light, or its
    weights, are split into slices, each for a machine.

    The settings are those of `aplanat.pareto`.
    """
    if points < 1:
        raise _aplanat.InputError(f"points: found {points}; expected 1 or more")
    if not 1 <= slices <= points:
        raise _aplanat.InputError(f"slices: found {slices}; expected 1 to the number of points")
    text = lens._native.to_json()
    tasks = [(text, one) for one in _slices(points, slices, settings)]
    found = [
        (from_json(json.loads(numbers)), parse_lens(lens))
        for front in each(_front, tasks)
        for numbers, lens in front
    ]
    best = [one for one in found if not any(_beats(two, one) for two in found)]
    # The lens at the start is in every slice.
    by_light = {numbers.light: (numbers, lens) for numbers, lens in reversed(best)}
    return [by_light[light] for light in sorted(by_light)]


def _slices(points: int, slices: int, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """The settings of the slices of a sweep: neighbours in its sequence of levels or weights."""
    weighted = settings.get("scalarization") == "weighted_sum"
    name, usual = ("blur", (4e-5, 3.5e-3)) if weighted else ("light", (0.4, 2.0))
    low, high = settings.get(name, usual)
    levels = [low * (high / low) ** (i / max(points - 1, 1)) for i in range(points)]
    edges = [points * i // slices for i in range(slices + 1)]
    parts = [levels[first:end] for first, end in zip(edges, edges[1:], strict=False)]
    return [{**settings, "points": len(part), name: [part[0], part[-1]]} for part in parts]


def _front(lens: str, settings: dict[str, Any]) -> list[tuple[str, str]]:
    sweep = _aplanat.ParetoSweep(_aplanat.Lens.from_json(lens), json.dumps(settings))
    while not json.loads(sweep.step())["finished"]:
        pass
    numbers, lenses = sweep.front()
    return [(json.dumps(n), lens.to_json()) for n, lens in zip(json.loads(numbers), lenses, strict=True)]


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
