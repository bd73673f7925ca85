"""One search on many machines, by Ray.

The search is split into groups of chains, each a run of its own with its own seed. Every group works for
as many gradients as a period has, on whatever machine is free; then it is given the best lenses of the
others, and judges them anew. A group may be a period ahead of the slowest one, and a period that takes
much longer than usual is begun a second time on a free machine. An actor holds the checkpoints of the
groups. A period that a machine loses is done again from where it began, and an actor that is lost goes
on from its file: the result depends on the seed and on the number of groups, not on the number of
machines, nor on what failed.

    python -m aplanat.ray search lens.json --out best.json --groups 8 --gradients 96000

Fronts, fields of refractive index and studies go to machines piece by piece. Without `--address` a
cluster is started on this machine.
"""

from __future__ import annotations

from .actor import Progress, connect, search
from .coordinator import Coordinator, run_here
from .periods import VERSION, Outcome, Period, Verdict, check, confirm, judge, work
from .schedule import LostPeriodError, Schedule
from .store import load, save
from .tasks import commands, each, grin, pareto, studies

__all__ = [
    "VERSION",
    "Coordinator",
    "LostPeriodError",
    "Outcome",
    "Period",
    "Progress",
    "Schedule",
    "Verdict",
    "check",
    "commands",
    "confirm",
    "connect",
    "each",
    "grin",
    "judge",
    "load",
    "pareto",
    "run_here",
    "save",
    "search",
    "studies",
    "work",
]
