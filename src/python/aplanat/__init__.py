"""Designs lenses by computation.

Lengths are in mm, angles in degrees, wavelengths in µm. Surfaces, fields and zoom positions are counted
from 0. A wrong input raises `InputError`, work that began and failed `WorkError`; both carry the text
that the command line prints.

>>> import aplanat
>>> lens = aplanat.Lens.bundled("double_gauss_rudolph_50")
>>> spot = aplanat.analyze(lens, "spot")
>>> print(spot.fields[0].rms)
"""

from __future__ import annotations

from ._aplanat import FATES, InputError, WorkError, __version__, bundled_names
from .commands import analyze, gradient, info, run, tolerance
from .lens import Lens, TracedRays
from .merit import Merit
from .results import Estimate, Result
from .runs import GrinTask, Optimizer, Search, pareto

__all__ = [
    "FATES",
    "Estimate",
    "GrinTask",
    "InputError",
    "Lens",
    "Merit",
    "Optimizer",
    "Result",
    "Search",
    "TracedRays",
    "WorkError",
    "__version__",
    "analyze",
    "bundled_names",
    "gradient",
    "info",
    "pareto",
    "run",
    "tolerance",
]
