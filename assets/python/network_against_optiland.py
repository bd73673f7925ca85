"""The example of a lens and a network, with Aplanat and with Optiland's torch backend, in turn.

    pip install '.[torch]' optiland
    python assets/python/network_against_optiland.py

Both programs are the same but for the trace: the same rays, curvatures, network and optimizer, in double
precision, with the rims of the lens. Prints the time of a step of both and that they do the same.
"""

import argparse
import json
from statistics import median

import lens_and_network
import numpy as np
import optiland.backend as be
import torch
from optiland.materials import Material
from optiland.optic import Optic
from optiland.rays import RealRays

import aplanat
from aplanat import torch as optics


def optiland_lens(lens: aplanat.Lens) -> Optic:
    """The lens in Optiland, with glasses of its own catalogue."""
    data, optic = lens.data, Optic()
    optic.surfaces.add(index=0, thickness=np.inf)
    for i, row in enumerate(data["surfaces"]):
        maker, glass = row["glass"].split() if "glass" in row else ("", "air")
        optic.surfaces.add(
            index=i + 1,
            radius=1 / row["curvature"] if row.get("curvature") else np.inf,
            thickness=row["thickness"],
            material=Material(glass, maker.lower()) if maker else "air",
            is_stop=row.get("stop", False),
            aperture=2 * row["semi_diameter"],
        )
    optic.surfaces.add(index=len(data["surfaces"]) + 1)
    optic.set_aperture("EPD", 5.0)
    optic.fields.set_type("angle")
    optic.fields.add(y=0)
    optic.wavelengths.add(aplanat_primary(lens), is_primary=True)
    return optic


def aplanat_primary(lens: aplanat.Lens) -> float:
    """The primary wavelength in µm."""
    return next(row["um"] for row in lens.data["wavelengths"] if row.get("primary"))


def trace_with_optiland(lens: aplanat.Lens):
    """The trace of the example by Optiland."""
    optic, um = optiland_lens(lens), aplanat_primary(lens)

    def trace(numbers: dict, points: np.ndarray, directions: np.ndarray) -> tuple:
        for name, curvature in numbers.items():
            surface = optic.surfaces[int(name[len("curvature[") : -1]) + 1]
            surface.geometry.radius = 1 / curvature
        columns = [torch.as_tensor(column) for column in (*points.T.copy(), *directions.T.copy())]
        ones = torch.ones(len(points), dtype=torch.float64)
        rays = RealRays(*columns, ones, um * ones)
        optic.surfaces.trace(rays, skip=1, record=False)
        return torch.stack([rays.x, rays.y], dim=1), rays.i > 0

    return trace


def trace_with_aplanat(lens: aplanat.Lens):
    """The trace of the example by Aplanat."""

    def trace(numbers: dict, points: np.ndarray, directions: np.ndarray) -> tuple:
        landed, _, _, imaged = optics.trace(lens, numbers, points, directions)
        return landed, imaged

    return trace


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--turns", type=int, default=5)
    options = parser.parse_args()
    be.set_backend("torch")
    be.set_precision("float64")
    be.grad_mode.disable()  # Only the curvatures have derivatives, as in the other program.
    lens = aplanat.Lens.bundled(lens_and_network.NAME)
    traces = {"aplanat": trace_with_aplanat(lens), "optiland": trace_with_optiland(lens)}
    seconds: dict[str, list[float]] = {name: [] for name in traces}
    errors = {}
    for _ in range(options.turns):
        for name, trace in traces.items():
            errors[name], spent = lens_and_network.optimize(lens, trace, options.steps)
            seconds[name].append(spent)
    first, last = ({name: found[i] for name, found in errors.items()} for i in (0, -1))
    result = {
        "rays": lens_and_network.RAYS,
        "threads": torch.get_num_threads(),
        "first_error_um": first,
        "last_error_um": last,
        "ms_a_step": {name: 1e3 * median(found) for name, found in seconds.items()},
        "times_faster": median(
            theirs / ours for ours, theirs in zip(seconds["aplanat"], seconds["optiland"], strict=True)
        ),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
