"""Lenses and rays."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _aplanat

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TracedRays:
    """The ends of rays; zeros for a ray that is lost.

    Points and directions are in the frame of the last surface, the image plane.
    """

    points: Floats
    """Shape (rays, 3), in mm."""
    directions: Floats
    """Shape (rays, 3), direction cosines behind the last surface."""
    opl: Floats
    """Shape (rays,), the optical path from the start, in mm."""
    fate: npt.NDArray[np.uint8]
    """Shape (rays,), an index of `aplanat.FATES`; 0 is a ray that arrives."""
    surface: npt.NDArray[np.uint32]
    """Shape (rays,), the surface at which a ray ends."""

    @classmethod
    def allocate(cls, rays: int) -> TracedRays:
        """Arrays for the ends of so many rays, with nothing in them."""
        points, directions = np.empty((rays, 3)), np.empty((rays, 3))
        return cls(
            points, directions, np.empty(rays), np.empty(rays, np.uint8), np.empty(rays, np.uint32)
        )

    @property
    def imaged(self) -> npt.NDArray[np.bool_]:
        """Shape (rays,), true for a ray that arrives."""
        return self.fate == 0


class Lens:
    """A lens. Its numbers have names such as `curvature[2]`, `thickness[0]`, `asphere[1,0]`.

    `lens["curvature[2]"]` reads a number, `lens["curvature[2]"] = 0.01` writes it, `names()` lists all.
    Everything else is in `data`, the content of the lens file.
    """

    def __init__(self, data: Mapping[str, Any] | _aplanat.Lens) -> None:
        """A lens from the content of a lens file; `Lens.open` reads a file."""
        is_native = isinstance(data, _aplanat.Lens)
        self._native = data if is_native else _aplanat.Lens.from_json(json.dumps(data))
        self._merits: dict[Any, Any] = {}

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Lens:
        """Reads a lens from a file: .json, .zmx, .zar, .seq, .len or .roa."""
        return cls(_aplanat.Lens.open(os.fspath(path)))

    @classmethod
    def bundled(cls, name: str) -> Lens:
        """The bundled lens of this name; `aplanat.bundled_names()` lists them."""
        return cls(_aplanat.Lens.bundled(name))

    def save(self, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Writes the lens in the format of the extension: .json, .zmx, .seq, .len or .roa.

        Returns the report: what the format cannot hold, and how rays through the file compare.
        """
        return json.loads(self._native.save(os.fspath(path)))

    @property
    def data(self) -> dict[str, Any]:
        """The content of the lens file, a copy."""
        return json.loads(self._native.to_json())

    def names(self) -> list[str]:
        """The names of all its numbers."""
        return self._native.names()

    def __contains__(self, name: object) -> bool:
        return name in self.names()

    def __getitem__(self, name: str) -> float:
        return self._native.get(name)

    def __setitem__(self, name: str, value: float) -> None:
        self._native.set(name, float(value))
        self._merits.clear()

    def numbers(self) -> dict[str, float]:
        """All its numbers by name."""
        return {name: self[name] for name in self.names()}

    def with_numbers(self, numbers: Mapping[str, float]) -> Lens:
        """A copy with other values of some numbers."""
        copy = self.copy()
        for name, value in numbers.items():
            copy[name] = value
        return copy

    def copy(self) -> Lens:
        """A copy."""
        return Lens(self._native.copy())

    @property
    def surface_count(self) -> int:
        """The number of its surfaces, without object and image."""
        return self._native.surface_count()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Lens) and self._native == other._native

    __hash__ = None  # type: ignore[assignment]
    __iter__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(self._native)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Lens, (self.data,))

    def trace(
        self,
        points: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        wavelength: float | None = None,
        zoom: int = 0,
        out: TracedRays | None = None,
    ) -> TracedRays:
        """Traces rays on all cores; other threads of Python run meanwhile.

        `points` and `directions` have shape (rays, 3): mm and direction cosines in the frame of the
        first vertex. Arrays of 64-bit numbers are read where they lie, whatever their strides: change
        them only afterwards; directions of fewer bits are scaled to the length 1. `wavelength` is in µm; the
        primary one if it is absent. The arrays of `out`, such as an earlier result for as many rays, are
        written again and returned.
        """
        rays = as_rays(points), as_directions(directions)
        ends = TracedRays.allocate(len(rays[0])) if out is None else out
        arrays = (ends.points, ends.directions, ends.opl, ends.fate, ends.surface)
        _aplanat.trace_rays(self._native, *rays, wavelength, zoom, arrays)
        return ends

    def ray_gradient(
        self,
        names: list[str],
        points: npt.ArrayLike,
        directions: npt.ArrayLike,
        by_point: npt.ArrayLike,
        by_direction: npt.ArrayLike | None = None,
        by_opl: npt.ArrayLike | None = None,
        *,
        wavelength: float | None = None,
        zoom: int = 0,
    ) -> Floats:
        """The derivatives by the named numbers of a sum over rays, by the adjoint trace.

        `by_point`, `by_direction` of shape (rays, 3) and `by_opl` of shape (rays,) are the derivatives
        of the sum by what `trace` returns. Lost rays do not contribute. Shape (names,).
        """
        points = as_rays(points)
        zeros = np.zeros_like(points)
        seeds = [as_rays(by_point), zeros if by_direction is None else as_rays(by_direction)]
        paths = np.zeros(len(points)) if by_opl is None else np.ascontiguousarray(by_opl, np.float64)
        return _aplanat.ray_gradient(
            self._native, points, as_directions(directions), wavelength, zoom, list(names), *seeds, paths
        )


def as_rays(rays: npt.ArrayLike) -> Floats:
    """An array of 64-bit numbers, a ray a row; what is one already is not copied."""
    given = np.asarray(rays)
    if np.iscomplexobj(given):
        raise _aplanat.InputError("found complex numbers; expected real ones")
    array = np.asarray(given, np.float64)
    if array.ndim != 2:
        raise _aplanat.InputError(f"found an array of shape {array.shape}; expected (rays, 3)")
    return array


def as_directions(rays: npt.ArrayLike) -> Floats:
    """The same for directions; those of fewer bits have the length 1 only to their own rounding."""
    given = np.asarray(rays)
    array = as_rays(given)
    if given.dtype.kind != "f" or given.dtype.itemsize >= 8:
        return array
    length = np.linalg.norm(array, axis=1, keepdims=True)
    # Others are no rounded directions, and are refused by their number.
    is_rounded = np.abs(length - 1.0) < 32 * np.finfo(given.dtype).eps
    return np.divide(array, length, out=array.copy(), where=is_rounded)
