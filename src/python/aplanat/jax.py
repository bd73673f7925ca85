"""Differentiable functions of a lens for JAX.

As `aplanat.torch`, with arrays in place of tensors. The numbers are computed with 64 bits; JAX keeps
them so if `jax_enable_x64` is on. The functions may be differentiated by the numbers of the lens and
compiled, not mapped; given rays are no tracers. JAX wraps what goes wrong while they run, such as a lens
without light, in its own `JaxRuntimeError`, which ends with the text.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .lens import Lens
from .merit import Goal, Merit, goal_of_term, merit_of

Arrays = Mapping[str, jax.Array]


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _merit(function: Merit, values: jax.Array) -> jax.Array:
    return _merit_with_slopes(function, values)[0]


def _merit_with_slopes(function: Merit, values: jax.Array) -> tuple[jax.Array, jax.Array]:
    def evaluate(values: Any) -> tuple[np.ndarray, np.ndarray]:
        value, slopes = function.gradient(np.asarray(values, np.float64))
        return np.asarray(value, values.dtype), slopes.astype(values.dtype)

    shapes = (
        jax.ShapeDtypeStruct((), values.dtype),
        jax.ShapeDtypeStruct(values.shape, values.dtype),
    )
    return jax.pure_callback(evaluate, shapes, values)


_merit.defvjp(_merit_with_slopes, lambda _function, slopes, by: (by * slopes,))


def _vector(arrays: Arrays) -> jax.Array:
    values = [jnp.asarray(value, float) for value in arrays.values()]
    return jnp.stack(values) if values else jnp.zeros(0)


def merit(
    lens: Lens, arrays: Arrays, goal: Goal | None = None, *, tolerance: float = 1e-6
) -> jax.Array:
    """The merit function, a scalar; that of the lens file without a goal."""
    return _merit(merit_of(lens, list(arrays), goal, tolerance), _vector(arrays))


def spot(lens: Lens, arrays: Arrays, *, tolerance: float = 1e-6) -> jax.Array:
    """The RMS spot radius over fields, wavelengths and zoom positions by weight, in mm."""
    return jnp.sqrt(merit(lens, arrays, goal_of_term("spot"), tolerance=tolerance))


def throughput(lens: Lens, arrays: Arrays, *, tolerance: float = 1e-6) -> jax.Array:
    """The mean area of the pupil in the plane of the first vertex, in mm²."""
    return -merit(lens, arrays, goal_of_term("throughput"), tolerance=tolerance)


def mtf(lens: Lens, arrays: Arrays, frequency: float, *, tolerance: float = 1e-6) -> jax.Array:
    """The geometric modulation transfer at a frequency in cycles/mm, as in `aplanat.torch.mtf`."""
    term = {"geometric_mtf": {"frequency": float(frequency), "min": 1.0}}
    return 1.0 - jnp.sqrt(merit(lens, arrays, goal_of_term(term), tolerance=tolerance))


class _RayCall:
    """Rays through a lens as a function of some of its numbers; equal only to itself."""

    def __init__(self, lens: Lens, names: list[str], points: Any, directions: Any, options: Any) -> None:
        self.lens, self.names, self.options = lens, names, options
        self.points, self.directions = np.asarray(points), np.asarray(directions)

    def at(self, values: Any) -> Lens:
        return self.lens.with_numbers(dict(zip(self.names, map(float, values), strict=True)))

    def ends(self, values: Any) -> tuple[np.ndarray, ...]:
        traced = self.at(values).trace(self.points, self.directions, **self.options)
        ends = (traced.points, traced.directions, traced.opl)
        return (*(end.astype(values.dtype) for end in ends), traced.imaged)

    def slopes(self, values: Any, *by: Any) -> np.ndarray:
        seeds = [np.asarray(part, np.float64) for part in by]
        slopes = self.at(values).ray_gradient(
            self.names, self.points, self.directions, *seeds, **self.options
        )
        return slopes.astype(values.dtype)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _trace(call: _RayCall, values: jax.Array) -> tuple[jax.Array, ...]:
    rays = len(call.points)
    numbers = partial(jax.ShapeDtypeStruct, dtype=values.dtype)
    shapes = (numbers((rays, 3)), numbers((rays, 3)), numbers((rays,)))
    return jax.pure_callback(call.ends, (*shapes, jax.ShapeDtypeStruct((rays,), bool)), values)


def _trace_backward(call: _RayCall, values: jax.Array, by: tuple[jax.Array, ...]) -> tuple[jax.Array]:
    shape = jax.ShapeDtypeStruct(values.shape, values.dtype)
    return (jax.pure_callback(call.slopes, shape, values, *by[:3]),)


_trace.defvjp(lambda call, values: (_trace(call, values), values), _trace_backward)


def trace(
    lens: Lens,
    arrays: Arrays,
    points: Any,
    directions: Any,
    *,
    wavelength: float | None = None,
    zoom: int = 0,
) -> tuple[jax.Array, ...]:
    """Traces given rays, of shape (rays, 3) each; returns what `aplanat.torch.trace` does."""
    options = {"wavelength": wavelength, "zoom": zoom}
    return _trace(_RayCall(lens, list(arrays), points, directions, options), _vector(arrays))
