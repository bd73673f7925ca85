"""The command line: `python -m aplanat.ray search lens.json --out best.json`."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import aplanat

from . import LostPeriodError, commands, grin, pareto, search, studies

EXTENSIONS = (".json", ".zmx", ".seq", ".len", ".roa")
LENS_HELP = "the lens: .json, .zmx, .zar, .seq, .len or .roa"


def _search(options: argparse.Namespace) -> dict[str, Any]:
    plan = json.loads(Path(options.plan).read_text(encoding="utf-8")) if options.plan else {}
    plan.setdefault("settings", {})["seed"] = options.seed
    _check_out(Path(options.out))
    begun = search(
        aplanat.Lens.open(options.lens),
        plan,
        gradients=options.gradients,
        groups=options.groups,
        period=options.period,
        checkpoint=options.checkpoint,
        watch=options.watch,
    )
    said = 0
    for progress in begun:
        merit, best = progress.best
        print(f"{progress.gradients} gradients, merit {merit:.6g}", file=sys.stderr)
        for message in progress.messages[said:]:
            print(f"note: {message}", file=sys.stderr)
        said = len(progress.messages)
        best.save(options.out)
    fingerprint = progress.fingerprint
    return {"merit": merit, "gradients": progress.gradients, "fingerprint": fingerprint}


def _check_out(path: Path) -> None:
    """Refuses a file that cannot hold a lens before any work is done for it."""
    if path.suffix not in EXTENSIONS:
        raise aplanat.InputError(f"{path}: expected a name that ends in {', '.join(EXTENSIONS)}")
    if not path.absolute().parent.is_dir():
        raise aplanat.InputError(f"{path}: its folder does not exist")


def _pareto(options: argparse.Namespace) -> list[dict[str, Any]]:
    lens = aplanat.Lens.open(options.lens)
    settings = {} if options.steps is None else {"steps": options.steps}
    settings["light"] = options.light
    front = pareto(lens, points=options.points, slices=options.slices, **settings)
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for i, (numbers, found) in enumerate(front):
        path = folder / f"lens-{i:02}.json"
        found.save(path)
        rows.append({"spot": numbers.spot, "light": numbers.light, "file": str(path)})
    return rows


def _grin(options: argparse.Namespace) -> list[dict[str, Any]]:
    tasks = [_task(word) for word in options.tasks]
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for word, (index, low, spacing) in zip(options.tasks, grin(tasks, options.nodes), strict=True):
        path = folder / f"{Path(word).stem}.npz"
        # The order of a volume that the program reads: (z, y, x).
        np.savez_compressed(path, index=index.transpose(2, 1, 0), low=low, spacing=spacing)
        rows.append({"task": word, "lowest": index.min(), "highest": index.max(), "file": str(path)})
    return rows


def _task(word: str) -> str | dict[str, Any]:
    is_file = word.endswith(".json")
    return json.loads(Path(word).read_text(encoding="utf-8")) if is_file else word


def _study(options: argparse.Namespace) -> list[Any]:
    return [_plain(result) for result in studies(options.words, options.seeds)]


def _commands(options: argparse.Namespace) -> list[Any]:
    text = Path(options.file).read_text(encoding="utf-8")
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    return [_plain(result) for result in commands(line for line in lines if line)]


def _plain(value: Any) -> Any:
    """A result as JSON has it, with seconds for milliseconds."""
    if isinstance(value, aplanat.Result):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, aplanat.Estimate):
        return dict(vars(value))
    return [_plain(entry) for entry in value] if isinstance(value, list) else value


def _seeds(text: str) -> range:
    """The seeds of `1-8`, or of one number."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m aplanat.ray", description="Aplanat on the machines of a Ray cluster."
    )
    parser.add_argument("--address", help="the cluster of Ray; absent: one on this machine")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_search(commands)
    front = _command(commands, "pareto", _pareto, "the front of sharpness against light")
    front.add_argument("lens", help=LENS_HELP)
    front.add_argument("--out", required=True, help="the folder for the lenses")
    front.add_argument("--points", type=int, default=20, help="levels of light")
    front.add_argument("--slices", type=int, default=2, help="parts of the front, one a machine")
    front.add_argument("--steps", type=int, help="steps for each level")
    front.add_argument("--light", type=float, nargs=2, default=[0.4, 2.0], help="the range of light")
    fields = _command(commands, "grin", _grin, "fields of refractive index, a task a machine")
    fields.add_argument("tasks", nargs="+", help="names of built-in tasks, or task files")
    fields.add_argument("--out", required=True, help="the folder for the fields")
    fields.add_argument("--nodes", type=int, default=65, help="nodes of the longest side")
    study = _command(commands, "study", _study, "a command of aplanat for many seeds, one a machine")
    study.add_argument("--seeds", type=_seeds, required=True, help="the seeds, as in 1-8")
    study.add_argument("words", nargs="+", help="the command; {seed} in it stands for the seed")
    lines = _command(commands, "commands", _commands, "commands of aplanat, one a machine")
    lines.add_argument("file", help="a file with a command a line")
    return parser


def _command(
    commands: Any, name: str, function: Callable[[argparse.Namespace], Any], text: str
) -> argparse.ArgumentParser:
    command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    command.set_defaults(function=function)
    command.add_argument("--address", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    return command


def _add_search(commands: Any) -> None:
    search = _command(commands, "search", _search, "optimizes the structure of a lens")
    search.add_argument("lens", help=LENS_HELP)
    search.add_argument("--out", required=True, help="the file for the best lens, by its extension")
    search.add_argument("--gradients", type=int, default=12_000, help="gradients of all groups (12000); a checkpoint keeps its own")
    search.add_argument("--groups", type=int, default=2, help="groups of chains, at least one a core (2)")
    search.add_argument("--period", type=int, default=1000, help="gradients between two exchanges (1000)")
    search.add_argument("--seed", type=int, default=1, help="the seed of all random numbers (1)")
    search.add_argument("--plan", help="the plan as JSON: goal, rules, local, settings")
    search.add_argument("--checkpoint", help="saves the search here; goes on from it if it exists")
    search.add_argument("--watch", help="saves the best group here, for the studio")


def _main() -> int:
    options = _arguments().parse_args()
    try:
        # What is wrong with the words is refused before Ray is started, which takes seconds.
        if options.address:
            os.environ["RAY_ADDRESS"] = options.address
        result = options.function(options)
    except ImportError:
        print("error: Ray is not installed; expected `pip install 'aplanat[ray]'`", file=sys.stderr)
        return 2
    except (LostPeriodError, aplanat.WorkError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(_main())
