"""Differentiable functions of a lens for PyTorch.

Every function takes a lens and a dictionary of tensors, one number each, by the names of the numbers of
the lens that they replace; the others are those of the lens. Derivatives are those of the adjoint trace,
with the motion of the pupil's edge. There are first derivatives, by the numbers of the lens: second ones, those
by given rays, and the transforms of `torch.func` are refused. Rays are found for the lens as it is given:
once the tensors have moved far, go on with `lens.with_numbers(...)`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from . import _aplanat
from .lens import Lens
from .merit import Goal, Merit, goal_of_term, merit_of

Tensors = Mapping[str, torch.Tensor]


class _Merit(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, function: Merit, *values: torch.Tensor) -> torch.Tensor:
        value, gradient = function.gradient(_numbers(values))
        ctx.gradient = gradient
        return _like(values, value)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by: torch.Tensor) -> tuple[Any, ...]:
        return (None, *(by * float(slope) for slope in ctx.gradient))


class _Trace(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, call: tuple[Any, ...], *values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        lens, names, points, directions, options = call
        lens = lens.with_numbers(dict(zip(names, _numbers(values), strict=True)))
        traced = lens.trace(points, directions, **options)
        ctx.call = (lens, names, points, directions, options)
        imaged = torch.from_numpy(traced.imaged)
        ctx.mark_non_differentiable(imaged)
        ends = (traced.points, traced.directions, traced.opl)
        return (*(_like(values, end) for end in ends), imaged)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *by: torch.Tensor) -> tuple[Any, ...]:
        lens, names, points, directions, options = ctx.call
        seeds = [part.detach().cpu().double().numpy() for part in by[:3]]
        slopes = lens.ray_gradient(names, points, directions, *seeds, **options)
        return (None, *(by[0].new_tensor(slope) for slope in slopes))


def _like(values: tuple[torch.Tensor, ...], number: Any) -> torch.Tensor:
    """A tensor of the kind of the values; of 64 bits without any."""
    return values[0].new_tensor(number) if values else torch.as_tensor(number, dtype=torch.float64)


def _numbers(values: tuple[torch.Tensor, ...]) -> np.ndarray:
    return np.array([float(value.detach()) for value in values])


def _tensors(tensors: Tensors) -> list[torch.Tensor]:
    """The tensors; plain numbers have 64 bits, as Python has them."""
    return [
        value if isinstance(value, torch.Tensor) else torch.tensor(value, dtype=torch.float64)
        for value in tensors.values()
    ]


def _fixed(rays: Any) -> np.ndarray:
    given = torch.as_tensor(rays)
    if given.requires_grad:
        raise _aplanat.InputError("found rays that require a gradient; expected `rays.detach()`: there is none")
    return given.cpu().numpy()


def trace(
    lens: Lens,
    tensors: Tensors,
    points: Any,
    directions: Any,
    *,
    wavelength: float | None = None,
    zoom: int = 0,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """Traces given rays, of shape (rays, 3) each.

    Returns points and directions at the image, of shape (rays, 3), optical paths, of shape (rays,), and
    which rays arrive, of shape (rays,); zeros for a ray that is lost.
    """
    given = [_fixed(rays) for rays in (points, directions)]
    options = {"wavelength": wavelength, "zoom": zoom}
    return _Trace.apply((lens, list(tensors), *given, options), *_tensors(tensors))


def merit(
    lens: Lens, tensors: Tensors, goal: Goal | None = None, *, tolerance: float = 1e-6
) -> torch.Tensor:
    """The merit function, a scalar; that of the lens file without a goal."""
    return _Merit.apply(merit_of(lens, list(tensors), goal, tolerance), *_tensors(tensors))


def spot(lens: Lens, tensors: Tensors, *, tolerance: float = 1e-6) -> torch.Tensor:
    """The RMS spot radius over fields, wavelengths and zoom positions by weight, in mm."""
    return merit(lens, tensors, goal_of_term("spot"), tolerance=tolerance).sqrt()


def throughput(lens: Lens, tensors: Tensors, *, tolerance: float = 1e-6) -> torch.Tensor:
    """The mean area of the pupil in the plane of the first vertex, in mm²."""
    return -merit(lens, tensors, goal_of_term("throughput"), tolerance=tolerance)


def mtf(lens: Lens, tensors: Tensors, frequency: float, *, tolerance: float = 1e-6) -> torch.Tensor:
    """The geometric modulation transfer at a frequency in cycles/mm.

    Over fields and both directions it is 1 minus the root mean square of what is missing from 1.
    """
    term = {"geometric_mtf": {"frequency": float(frequency), "min": 1.0}}
    return 1.0 - merit(lens, tensors, goal_of_term(term), tolerance=tolerance).sqrt()
