"""Rays against closed forms and differences."""

import numpy as np
import pytest

import aplanat


def one_surface(curvature: float, index: float, gap: float) -> aplanat.Lens:
    """A sphere in front of a constant medium in which the image lies."""
    lens = aplanat.Lens.bundled("singlet_la1131").data
    row = {"curvature": curvature, "thickness": gap, "glass": {"index": index}, "stop": True}
    lens["surfaces"] = [row]
    lens["aperture"] = {"stop_semi_diameter": 10.0}
    for key in ("variables", "pickups", "zoom", "merit"):
        lens.pop(key, None)
    return aplanat.Lens(lens)


def beam(rays: int, radius: float, seed: int = 1):
    random = np.random.default_rng(seed)
    points = np.zeros((rays, 3))
    points[:, :2] = random.uniform(-radius, radius, (rays, 2))
    points[:, 2] = -5.0
    directions = np.zeros((rays, 3))
    directions[:, :2] = random.uniform(-0.1, 0.1, (rays, 2))
    directions[:, 2] = np.sqrt(1 - (directions[:, :2] ** 2).sum(axis=1))
    return points, directions


def test_a_sphere_refracts_by_snells_law():
    curvature, index, gap = 0.04, 1.6, 30.0
    lens = one_surface(curvature, index, gap)
    points, directions = beam(1000, 4.0)
    traced = lens.trace(points, directions)
    # The sphere about (0, 0, 1/c), met by solving the quadratic equation.
    center = np.array([0.0, 0.0, 1 / curvature])
    away = points - center
    b = (away * directions).sum(axis=1)
    root = np.sqrt(b**2 - (away**2).sum(axis=1) + 1 / curvature**2)
    path = -b - root
    met = points + path[:, None] * directions
    normal = (center - met) * curvature
    cosine = (normal * directions).sum(axis=1)
    refracted = np.sqrt(index**2 - 1 + cosine**2)
    behind = (directions + (refracted - cosine)[:, None] * normal) / index
    further = (gap - met[:, 2]) / behind[:, 2]
    landed = met + further[:, None] * behind
    assert traced.imaged.all()
    assert np.abs(traced.points[:, :2] - landed[:, :2]).max() < 1e-12
    assert np.abs(traced.directions - behind).max() < 1e-14
    assert np.abs(traced.opl - (path + index * further)).max() < 1e-12


def test_lost_rays_have_a_fate_and_no_numbers(double_gauss):
    points, directions = beam(100, 500.0)
    traced = double_gauss.trace(points, directions)
    lost = ~traced.imaged
    assert lost.sum() > 50 and np.isfinite(traced.points).all()
    assert (traced.points[lost] == 0).all()
    names = {aplanat.FATES[fate] for fate in traced.fate[lost]}
    assert names <= {"missed", "clipped", "total_reflection"} and names


@pytest.mark.parametrize("name", ["double_gauss_rudolph_50", "phone_us7558005_1"])
def test_gradients_of_rays_are_those_of_differences(name):
    lens = aplanat.Lens.bundled(name)
    radius = 0.2 * lens["semi_diameter[0]"]
    points, directions = beam(200, radius)
    directions = np.tile([0.0, 0.0, 1.0], (200, 1))
    random = np.random.default_rng(2)
    seeds = [random.normal(size=(200, 3)), random.normal(size=(200, 3)), random.normal(size=200)]
    seeds[0][:, 2] = 0.0
    kinds = ("curvature", "thickness", "conic", "asphere")
    names = [name for name in lens.names() if name.startswith(kinds)]
    gradient = lens.ray_gradient(names, points, directions, *seeds)

    def total(lens):
        traced = lens.trace(points, directions)
        assert traced.imaged.all()
        parts = (traced.points * seeds[0], traced.directions * seeds[1], traced.opl * seeds[2])
        return sum(part.sum() for part in parts)

    for name, slope in zip(names, gradient, strict=True):
        unit = radius ** -(2 * int(name.split(",")[1][:-1]) + 4) if "," in name else 1.0
        step = 1e-5 * unit
        ahead, behind = (
            total(lens.with_numbers({name: lens[name] + sign * step})) for sign in (1, -1)
        )
        difference = (ahead - behind) / (2 * step)
        scale = abs(difference) + 1e-4 * np.abs(gradient).max() + 1e-6
        assert abs(slope - difference) < 2e-5 * scale, (name, slope, difference)


@pytest.mark.parametrize(
    ("points", "directions"),
    [
        (np.zeros((3, 2)), np.zeros((3, 2))),
        (np.zeros((3, 3)), np.zeros((2, 3))),
        (np.zeros(3), np.zeros(3)),
        (np.zeros((1, 3)), np.zeros((1, 3))),
        (np.full((1, 3), np.nan), np.array([[0.0, 0.0, 1.0]])),
    ],
)
def test_rays_that_are_none_are_refused(singlet, points, directions):
    with pytest.raises(aplanat.InputError, match=r"expected|ray"):
        singlet.trace(points, directions)


def test_no_rays_are_no_error(singlet):
    traced = singlet.trace(np.zeros((0, 3)), np.zeros((0, 3)))
    assert traced.points.shape == (0, 3)


def test_wavelengths_and_zoom_positions_are_those_asked_for(singlet):
    points, directions = beam(10, 1.0)
    blue, red = (singlet.trace(points, directions, wavelength=um) for um in (0.4861327, 0.6562725))
    assert np.abs(blue.points - red.points).max() > 1e-3
    with pytest.raises(aplanat.InputError, match="zoom position 1"):
        singlet.trace(points, directions, zoom=1)
    with pytest.raises(aplanat.InputError, match="9"):
        singlet.trace(points, directions, wavelength=9.0)


def test_directions_of_fewer_bits_are_scaled_and_wrong_ones_refused(double_gauss):
    points, directions = beam(50, 3.0)
    exact = double_gauss.trace(points, directions)
    rounded = double_gauss.trace(points.astype(np.float32), directions.astype(np.float32))
    assert (rounded.fate == exact.fate).all()
    np.testing.assert_allclose(rounded.points, exact.points, atol=1e-4)
    with pytest.raises(aplanat.InputError, match="ray 0"):
        double_gauss.trace(points, (2 * directions).astype(np.float32))
    with pytest.raises(aplanat.InputError, match="complex"):
        double_gauss.trace(points + 0j, directions)


def test_a_wavelength_in_another_unit_is_refused(double_gauss):
    for wavelength in (550.0, 0.0, -1.0, float("nan")):
        with pytest.raises(aplanat.InputError, match="expected one from 0.05 to 50 um"):
            double_gauss.trace(*beam(2, 1.0), wavelength=wavelength)
