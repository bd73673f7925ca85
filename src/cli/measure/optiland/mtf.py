"""Contrast of a lens by Optiland: FFTMTF and GeometricMTF, timed, as JSON.

Arguments: the lens in Optiland's own format, the highest frequency in cycles/mm, the number of frequencies.
"""

import json
import sys
import time

import numpy as np
from importlib.metadata import version
from optiland.fileio import load_optiland_file
from optiland.mtf import FFTMTF, GeometricMTF

ZONES = [0.0, 0.7, 1.0]


def numpy(values):
    return np.asarray(values.detach() if hasattr(values, "detach") else values, dtype=float)


def fft(optic, wavelength, frequencies, rays):
    found = FFTMTF(optic, [(0.0, zone) for zone in ZONES], wavelength, num_rays=rays)

    def at(field, axis, known):
        return np.interp(frequencies, numpy(known[field]), numpy(found.mtf[field][axis])).tolist()

    fields = range(len(ZONES))
    return [[at(k, 0, found.freq_tang), at(k, 1, found.freq_sag)] for k in fields]


def geometric(optic, wavelength, frequencies, rays):
    # One point more for frequency 0; without the factor of a perfect lens, which is neither of both.
    found = GeometricMTF(
        optic,
        [(0.0, zone) for zone in ZONES],
        wavelength,
        num_rays=rays,
        num_points=len(frequencies) + 1,
        max_freq=frequencies[-1],
        scale=False,
    )
    return [[numpy(part)[1:].tolist() for part in field] for field in found.mtf]


def main():
    optic = load_optiland_file(sys.argv[1])
    highest, count = float(sys.argv[2]), int(sys.argv[3])
    frequencies = [highest * (i + 1) / count for i in range(count)]
    wavelengths = [wave.value for wave in optic.wavelengths.wavelengths]
    rows = []
    for method, name, sizes in [
        (geometric, "geometric", [50, 100, 200]),
        (fft, "diffraction", [64, 128, 256]),
    ]:
        method(optic, wavelengths[0], frequencies, sizes[0])  # Whatever is compiled on first use.
        for rays in sizes:
            start = time.perf_counter()
            values = [method(optic, wave, frequencies, rays) for wave in wavelengths]
            ms = 1e3 * (time.perf_counter() - start)
            rows.append({"method": name, "rays": rays, "ms": ms, "values": values})
    print(json.dumps({"version": version("optiland"), "rows": rows}))


main()
