"""The commands of the command line, on lenses in memory."""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from . import _aplanat
from .lens import Lens
from .results import Result, from_json


def run(*arguments: object) -> Any:
    """Runs a command as on the command line: `run("analyze", lens, "mtf", "--error", "1e-3")`.

    A `Lens` stands for its file. Returns a `Result`, or a list of them for a command that lists, such as
    `run("grin")` or `run("library")`. `run("help")` describes the commands. Ctrl-C ends a search, a front
    and the like with what they have, and leaves any other command to end by itself. For work of more than
    seconds take `Optimizer`, `pareto`, `Search` or `GrinTask`, which can be watched and stopped.
    """
    with tempfile.TemporaryDirectory(prefix="aplanat-") as folder:
        words = [_word(argument, folder, i) for i, argument in enumerate(arguments)]
        text, error, status = _run_interruptibly(words)
        if error is not None:
            # The reader of the message does not know the folder.
            error = error.replace(f"{folder}/", "")
            raise (_aplanat.InputError if status == 2 else _aplanat.WorkError)(error)
    found = json.loads(text) if text else {}
    return found if isinstance(found, str) else from_json(found)


def _run_interruptibly(words: list[str]) -> tuple[str, str | None, int]:
    """Runs a command in a thread of its own, so that Ctrl-C is noticed meanwhile."""
    if threading.current_thread() is not threading.main_thread():
        return _aplanat.run_command(words)
    outcomes: list[Any] = []

    def work() -> None:
        try:
            outcomes.append(_aplanat.run_command(words))
        except BaseException as error:  # What the library raises belongs to the caller.
            outcomes.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        # A signal that another thread receives is noticed between two waits.
        while thread.is_alive():
            thread.join(0.1)
    except KeyboardInterrupt:
        _aplanat.stop_commands()
        raise
    if isinstance(outcomes[0], BaseException):
        raise outcomes[0]
    return outcomes[0]


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
            words += [f"{option}={word}" for word in _values(value)]
    return words


def _values(value: Any) -> list[str]:
    """The values of an option: numbers of a list with commas; an option for each of a list of points."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        return [str(value)]
    entries = list(value)
    if entries and not any(isinstance(entry, (int, float)) or np.isscalar(entry) for entry in entries):
        return [word for entry in entries for word in _values(entry)]
    return [",".join(map(str, entries))]


def info(lens: Lens, **options: Any) -> Result:
    """First-order data, checks of the lens, and the effects that it calls for. The options are those of
    `aplanat info --help`, such as `zoom=1`."""
    return run("info", lens, *_options(options))


def analyze(lens: Lens, what: str, **options: Any) -> Result:
    """An analysis: each number is an `Estimate` with its error, rays and seconds.

    `what` is spot, spot-map, fan, distortion, distortion-grid, lateral-color, longitudinal, footprint,
    field-curvature, illumination, through-focus, wavefront, opd-fan, zernike, psf, encircled-energy, mtf,
    through-focus-mtf or ghosts. The options are those of `aplanat analyze --help`, such as
    `error=1e-3`, `field=10`, `zoom=1`, `frequencies=[10, 20]`, `at=[(0, 0), (0, 0.01)]`; as there,
    `surface=1` is the first one. Numbers of a single ray, and tables, are plain numbers, with the
    milliseconds of the whole beside them.
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
