"""The merit function as a function of numbers of a lens."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _aplanat
from .lens import Floats, Lens
from .results import Result, from_json

Goal = Mapping[str, Any]
"""A merit function as in a lens file: `{"terms": [{"term": "spot", "weight": 1}]}`."""


def goal_json(goal: Goal | None) -> str | None:
    """The JSON of a goal."""
    return None if goal is None else json.dumps(goal)


def goal_of_term(term: Any) -> dict[str, Any]:
    """A goal of one term with the weight 1."""
    return {"terms": [{"term": term, "weight": 1.0}]}


class Merit:
    """The merit function of a lens in some of its numbers.

    Its derivatives include the motion of the pupil's edge, unless the goal has `"pupil": "kept"`. The
    rays are found once, for the lens that it is made with; `resample` finds them anew.
    """

    def __init__(
        self,
        lens: Lens,
        goal: Goal | None = None,
        names: Sequence[str] | None = None,
        *,
        tolerance: float = 1e-6,
    ) -> None:
        """`goal` is that of the lens file if it is absent, `names` are the variables of the lens.

        Spot radii are good to the relative `tolerance`.
        """
        names = None if names is None else list(names)
        self._native = _aplanat.Merit(lens._native, goal_json(goal), names, tolerance)

    def values(self, lens: Lens) -> Floats:
        """The values of the variables in a lens. Shape (variables,)."""
        return self._native.values(lens._native)

    def lens(self, values: npt.ArrayLike) -> Lens:
        """The lens at these values of the variables."""
        return Lens(self._native.lens(_vector(values)))

    def value(self, values: npt.ArrayLike) -> float:
        """The merit."""
        return self._native.value(_vector(values))

    def gradient(self, values: npt.ArrayLike) -> tuple[float, Floats]:
        """The merit and its derivatives by the variables, of shape (variables,)."""
        return self._native.gradient(_vector(values))

    def terms(self, values: npt.ArrayLike) -> list[Result]:
        """Every term with its value, error and rays."""
        return from_json(json.loads(self._native.terms(_vector(values))))

    def resample(self, values: npt.ArrayLike) -> None:
        """Finds the rays anew for the lens at these values."""
        self._native.resample(_vector(values))


def merit_of(lens: Lens, names: Sequence[str], goal: Goal | None, tolerance: float) -> Merit:
    """The merit function of a lens, made once while the lens stays as it is."""
    key = (tuple(names), goal_json(goal), tolerance)
    if key not in lens._merits:
        lens._merits[key] = Merit(lens, goal, names, tolerance=tolerance)
    return lens._merits[key]


def _vector(values: npt.ArrayLike) -> Floats:
    return np.ascontiguousarray(values, np.float64)
