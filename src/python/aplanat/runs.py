"""Long runs as iterators: each step gives its progress; break off the loop to stop."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _aplanat
from .lens import Lens
from .merit import Goal, goal_json
from .results import Result, from_json


def _settings(settings: Mapping[str, Any] | None) -> str | None:
    return None if settings is None else json.dumps(settings)


class _Run(Iterator[Result]):
    """A run of the library whose steps return their progress as JSON."""

    _native: Any
    _is_over = False

    def _step(self) -> str:
        return self._native.step()

    def _ends_with(self, progress: Result) -> bool:
        return progress.finished

    def __next__(self) -> Result:
        if self._is_over:
            raise StopIteration
        progress = from_json(json.loads(self._step()))
        self._is_over = self._ends_with(progress)
        return progress


class Optimizer(_Run):
    """Local optimization.

    >>> optimizer = Optimizer(lens, names=["curvature[0]", "curvature[1]"])
    >>> for progress in optimizer:
    ...     print(progress.step, progress.best)
    >>> lens = optimizer.best
    """

    def __init__(
        self,
        lens: Lens,
        goal: Goal | None = None,
        names: Sequence[str] | None = None,
        *,
        method: str = "trust_region",
        tolerance: float = 1e-6,
    ) -> None:
        """`method` is trust_region, damped_least_squares or adam; `goal` that of the lens file if it is
        absent, `names` the variables of the lens."""
        names = None if names is None else list(names)
        self._native = _aplanat.Optimizer(lens._native, goal_json(goal), names, method, tolerance)

    @property
    def best(self) -> Lens:
        """The best lens so far."""
        return Lens(self._native.best())

    def verify(self) -> Result:
        """Evaluates the best lens with rays that are found anew: its terms, and the limits that hold it
        with their prices."""
        self._native.verify_best()
        return from_json(json.loads(self._native.report()))


class pareto(_Run):  # noqa: N801, a verb like the command
    """The front of sharpness against light. `front` has the lenses so far."""

    def __init__(self, lens: Lens, **settings: Any) -> None:
        """The settings are those of `aplanat pareto`: `points=20`, `steps=60`, `light=[0.4, 2.0]`,
        `tolerance=1e-2` for the spots, `scalarization="weighted_sum"`."""
        self._native = _aplanat.ParetoSweep(lens._native, _settings(settings or None))

    @property
    def front(self) -> list[tuple[Result, Lens]]:
        """The points of the front, each with its numbers and its lens, in the order of their light."""
        numbers, lenses = self._native.front()
        return list(zip(from_json(json.loads(numbers)), map(Lens, lenses), strict=True))


class Search(_Run):
    """A search over the structure of a lens; each step is a round of all its chains."""

    def __init__(
        self,
        lens: Lens,
        plan: Mapping[str, Any] | None = None,
        *,
        checkpoint: str | os.PathLike[str] | None = None,
    ) -> None:
        """`plan` has `goal`, `rules`, `local` and `settings`, as `aplanat help search` describes them; of
        the settings, `gradients` and `moves` are limits without which it goes on. With a checkpoint, for
        the same lens and plan, the search goes on from there."""
        path = None if checkpoint is None else os.fspath(checkpoint)
        self._native = _aplanat.Search(lens._native, _settings(plan), path)

    def _step(self) -> str:
        return self._native.round()

    def _ends_with(self, progress: Result) -> bool:
        return progress.ended is not None

    @property
    def best(self) -> Lens:
        """The best lens so far."""
        return Lens(self._native.best())

    @property
    def found(self) -> list[tuple[float, Lens]]:
        """The merits and the lenses found so far, the best first."""
        return [(merit, Lens(lens)) for merit, lens in zip(*self._native.found(), strict=True)]

    @property
    def reservoir(self) -> list[tuple[float, Lens]]:
        """The merits and the lenses that mutations begin with, as the search has them."""
        return [(merit, Lens(lens)) for merit, lens in zip(*self._native.reservoir(), strict=True)]

    def admit(self, lenses: Iterable[Lens]) -> list[bool]:
        """Admits lenses that other runs of the same search have found, and judges them anew; tells for
        each if it was accepted."""
        return self._native.admit([lens._native for lens in lenses])

    def save(self, checkpoint: str | os.PathLike[str]) -> None:
        """Saves the run; the studio opens it too."""
        self._native.save(os.fspath(checkpoint))


class GrinTask(_Run):
    """The design of a field of refractive index by the adjoint method."""

    def __init__(self, task: str | Mapping[str, Any]) -> None:
        """The name of a built-in task, which `run("grin")` lists, or the content of a task file."""
        self._native = _aplanat.GrinRun(task if isinstance(task, str) else json.dumps(task))

    def finish(self) -> None:
        """Scores the field of a run that is ended early."""
        self._native.finish()

    def field(
        self, nodes: int = 65
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The index of the best field at the nodes of a grid, of shape (x, y, z), with the lowest corner
        and the spacing of the grid in mm. A field that is a grid has its own nodes; one that is a function
        of a radius or of the axis is taken at 2 to 513 `nodes` along each side."""
        values, low, spacing = self._native.field(nodes)
        return values, np.asarray(low), np.asarray(spacing)
