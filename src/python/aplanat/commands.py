"""The commands of the command line, on lenses in memory."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from . import _aplanat
from .lens import Lens
from .results import Result


def run(*arguments: object) -> Result:
    """Runs a command as on the command line: `run("analyze", lens, "mtf", "--error", "1e-3")`.

    A `Lens` stands for its file. `aplanat help` of the program, or `run("help")`, describes them. For
    work of more than seconds take `Optimizer`, `pareto`, `Search` or `GrinTask`, which can be watched
    and stopped.
    """
    with tempfile.TemporaryDirectory(prefix="aplanat-") as folder:
        words = [_word(argument, folder, i) for i, argument in enumerate(arguments)]
        text, error, status = _aplanat.run_command(words)
        if error is not None:
            # The reader of the message does not know the folder.
            error = error.replace(f"{folder}/", "")
            raise (_aplanat.InputError if status == 2 else _aplanat.WorkError)(error)
    return Result(json.loads(text)) if text else Result({})


def _word(argument: object, folder: str, i: int) -> str:
    if not isinstance(argument, Lens):
        return str(argument)
    path = Path(folder) / f"lens{i or ''}.json"
    path.write_text(argument._native.to_json(), encoding="utf-8")
    return str(path)


def _options(options: dict[str, Any]) -> list[str]:
    """Options of the command line: `through_focus=True`, `frequencies=[10, 20]`, `error=1e-3`."""
    words = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            listed = isinstance(value, (list, tuple))
            words.append(f"{option}={','.join(map(str, value)) if listed else value}")
    return words


def info(lens: Lens) -> Result:
    """First-order data, checks of the lens, and the effects that it calls for."""
    return run("info", lens)


def analyze(lens: Lens, what: str, **options: Any) -> Result:
    """An analysis: each number is an `Estimate` with its error, rays and seconds.

    `what` is spot, fan, distortion, lateral-color, longitudinal, footprint, field-curvature,
    illumination, through-focus, wavefront, opd-fan, zernike, psf, encircled-energy, mtf,
    through-focus-mtf or ghosts. The options are those of `aplanat analyze --help`, such as
    `error=1e-3`, `field=10`, `zoom=1`, `frequencies=[10, 20]`.
    """
    return run("analyze", lens, what, *_options(options))


def gradient(lens: Lens, **options: Any) -> Result:
    """An integral over the pupil and its derivatives by all numbers of the lens.

    The options are those of `aplanat gradient --help`, such as `term="throughput"`,
    `method="biased"`.
    """
    return run("gradient", lens, *_options(options))


def tolerance(lens: Lens, **options: Any) -> Result:
    """What manufacturing errors do to the lens; the options are those of `aplanat tolerance --help`."""
    return run("tolerance", lens, *_options(options))
