"""The time that Python adds to the library: `python -m aplanat.measure`.

`trace` of a million rays against the library itself, which is given columns and a watch inside the call,
and the calls of gradients likewise. All are timed in turn, so that a busy machine slows all of them
alike; the figures are medians.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from . import _aplanat
from .commands import info
from .lens import Floats, Lens
from .merit import Merit

CALLS = 200
"""Calls of a gradient between two looks at the clock."""
FEW_RAYS = 64


def random_rays(lens: Lens, count: int, seed: int = 1) -> tuple[Floats, Floats]:
    """Rays through most of the entrance pupil, at up to 5 degrees, from 10 mm in front of the lens."""
    random, pupil = np.random.default_rng(seed), info(lens).entrance_pupil
    radius, angle = np.sqrt(random.uniform(0, 1, count)), random.uniform(0, 2 * np.pi, count)
    slopes = np.tan(np.radians(5.0)) * random.uniform(-0.7, 0.7, (count, 2))
    across = 0.4 * pupil.diameter * radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.full((count, 3), -10.0)
    points[:, :2] = across - slopes * (pupil.position + 10.0)
    directions = np.concatenate([slopes, np.ones((count, 1))], 1)
    return points, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _milliseconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)


def measure_trace(lens: Lens, rays: int = 1_000_000, turns: int = 15) -> dict[str, float]:
    """`Lens.trace` against the library, both with new arrays and with those of an earlier result."""
    points, directions = random_rays(lens, rays)
    out = lens.trace(points, directions)
    times = []
    for _ in range(turns):
        times.append(
            (
                _milliseconds(lambda: lens.trace(points, directions)),
                _milliseconds(lambda: lens.trace(points, directions, out=out)),
                *_aplanat.time_trace(lens._native, points, directions),
            )
        )
    names = ("python_ms", "python_reused_ms", "library_ms", "library_reused_ms")
    return {
        "rays": rays,
        **{name: median(column) for name, column in zip(names, zip(*times, strict=True), strict=True)},
        "ratio": median(row[0] / row[2] for row in times),
        "ratio_reused": median(row[1] / row[3] for row in times),
    }


def measure_merit_gradient(lens: Lens, turns: int = 25) -> dict[str, float]:
    """`Merit.gradient` of the spot against the library."""
    names = [name for name in lens.names() if name.startswith("curvature")]
    merit = Merit(lens, {"terms": [{"term": "spot", "weight": 1}]}, names, tolerance=1e-3)
    values = merit.values(lens)
    return _overhead(
        lambda: merit.gradient(values),
        lambda: _aplanat.time_gradient(merit._native, values, CALLS),
        turns,
    )


def measure_ray_gradient(lens: Lens, turns: int = 25) -> dict[str, float]:
    """`Lens.ray_gradient` of a few rays against the library."""
    names = [name for name in lens.names() if name.startswith("curvature")]
    points, directions = random_rays(lens, FEW_RAYS)
    up = np.tile([0.0, 1.0, 0.0], (FEW_RAYS, 1))
    return _overhead(
        lambda: lens.ray_gradient(names, points, directions, up),
        lambda: _aplanat.time_ray_gradient(lens._native, names, points, directions, CALLS),
        turns,
    )


def _overhead(call: Callable[[], object], library_ms: Callable[[], float], turns: int) -> dict[str, float]:
    """The microseconds of a call, of the library, and the difference."""

    def calls() -> None:
        for _ in range(CALLS):
            call()

    calls()
    times = [(_milliseconds(calls), library_ms()) for _ in range(turns)]
    unit = 1e3 / CALLS
    return {
        "python_us": unit * median(python for python, _ in times),
        "library_us": unit * median(library for _, library in times),
        "overhead_us": unit * median(python - library for python, library in times),
    }


def _main() -> None:
    parser = argparse.ArgumentParser(prog="python -m aplanat.measure", description=__doc__)
    parser.add_argument("--lens", default="double_gauss_rudolph_50", help="the name of a bundled lens")
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--turns", type=int, default=15)
    options = parser.parse_args()
    lens = Lens.bundled(options.lens)
    results = {
        "lens": options.lens,
        "trace": measure_trace(lens, options.rays, options.turns),
        "merit_gradient": measure_merit_gradient(lens),
        "ray_gradient": measure_ray_gradient(lens),
    }
    print(json.dumps(results, indent=2))


if __name__ == "__main__":
    _main()
