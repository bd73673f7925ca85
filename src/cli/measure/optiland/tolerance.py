"""Tolerances of a lens by Optiland: SensitivityAnalysis and MonteCarlo, timed, as JSON.

Arguments: the lens in Optiland's own format, the errors as JSON [[type, surface, axis or null, half range], ...],
the numbers of rings of rays as JSON, the number of random lenses.
"""

import json
import sys
import time

import numpy as np
from importlib.metadata import version
from optiland.fileio import load_optiland_file
from optiland.optimization.scaling.identity import IdentityScaler
from optiland.optimization.variable import Variable
from optiland.tolerancing import DistributionSampler, RangeSampler, SensitivityAnalysis, Tolerancing
from optiland.tolerancing.monte_carlo import MonteCarlo

# SensitivityAnalysis takes no more at once.
AT_ONCE = 6


def zones(optic):
    """The heights of the fields relative to the farthest one."""
    heights = [float(field.y) for field in optic.fields.fields]
    farthest = max(map(abs, heights))
    return [height / farthest if farthest > 0.0 else 0.0 for height in heights]


def tolerancing(optic, rings):
    task = Tolerancing(optic)
    for zone in zones(optic):
        about = {"optic": optic, "surface_number": -1, "Hx": 0.0, "Hy": zone}
        about |= {"num_rays": rings, "wavelength": "all", "nan_policy": "omit"}
        task.add_operand("rms_spot_size", about, target=0.0)
    return task


def where(error):
    kind, surface, axis, _ = error
    place = {"surface_number": surface}
    return kind, place if axis is None else place | {"axis": axis}


def value_of(optic, error):
    kind, place = where(error)
    return float(Variable(optic, kind, scaler=IdentityScaler(), **place).variable.get_value())


def growths(optic, errors, rings):
    """The mean over fields of the mean square, averaged over both ends of each error, less that of the lens."""
    found = []
    for start in range(0, len(errors), AT_ONCE):
        task = tolerancing(optic, rings)
        for error in errors[start : start + AT_ONCE]:
            kind, place = where(error)
            value, half = value_of(optic, error), error[3]
            task.add_perturbation(kind, RangeSampler(value - half, value + half, 3), **place)
        analysis = SensitivityAnalysis(task)
        analysis.run()
        rms = analysis.get_results()[analysis.operand_names].to_numpy(dtype=float)
        square = (rms**2).mean(axis=1).reshape(-1, 3)
        found += (0.5 * (square[:, 0] + square[:, 2]) - square[:, 1]).tolist()
    return found


def random_lenses(optic, errors, rings, count):
    task = tolerancing(optic, rings)
    for seed, error in enumerate(errors):
        kind, place = where(error)
        law = {"loc": value_of(optic, error), "scale": 0.5 * error[3]}
        task.add_perturbation(kind, DistributionSampler("normal", seed=seed, **law), **place)
    MonteCarlo(task).run(count)


def milliseconds(work, *arguments):
    start = time.perf_counter()
    result = work(*arguments)
    return result, 1e3 * (time.perf_counter() - start)


def row(optic, errors, rings, count):
    found, growth_ms = milliseconds(growths, optic, errors, rings)
    _, lenses_ms = milliseconds(random_lenses, optic, errors, rings, count)
    waves = len(optic.wavelengths.get_wavelengths())
    rays = waves * len(zones(optic)) * (1 + 3 * rings * (rings + 1))
    growth = [value if np.isfinite(value) else None for value in found]
    return {"rays": rays, "growth": growth, "sensitivities_ms": growth_ms, "lens_ms": lenses_ms / count}


def main():
    optic = load_optiland_file(sys.argv[1])
    errors, rings = json.loads(sys.argv[2]), json.loads(sys.argv[3])
    growths(optic, errors[:1], rings[0])  # Whatever is compiled on first use.
    rows = [row(optic, errors, number, int(sys.argv[4])) for number in rings]
    print(json.dumps({"version": version("optiland"), "rows": rows}))


main()
