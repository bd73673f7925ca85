"""Derivatives of PyTorch and JAX against differences. Each is left out where it is not installed."""

import importlib.util

import numpy as np
import pytest

import aplanat

NAMES = ["curvature[0]", "curvature[2]", "thickness[1]"]
needs_torch = pytest.mark.skipif(
    importlib.util.find_spec("torch") is None, reason="PyTorch is not installed"
)
needs_jax = pytest.mark.skipif(importlib.util.find_spec("jax") is None, reason="JAX is not installed")


def rays():
    points = np.array([[x, y, -1.0] for x in (-3.0, 0.5) for y in (-2.0, 4.0)])
    return points, np.tile([0.0, 0.05, np.sqrt(1 - 0.05**2)], (4, 1))


@needs_torch
@pytest.mark.parametrize("what", ["spot", "throughput", "mtf", "trace"])
def test_torch_passes_gradcheck(double_gauss, what):
    import torch

    from aplanat import torch as optics

    def function(*values):
        tensors = dict(zip(NAMES, values, strict=True))
        if what == "trace":
            points, directions, opl, imaged = optics.trace(double_gauss, tensors, *rays())
            assert imaged.all()
            return points, directions, opl
        frequency = (20.0,) if what == "mtf" else ()
        return getattr(optics, what)(double_gauss, tensors, *frequency)

    values = [
        torch.tensor(double_gauss[name], dtype=torch.float64, requires_grad=True) for name in NAMES
    ]
    assert torch.autograd.gradcheck(function, values, eps=1e-6, atol=1e-4, rtol=1e-3)


@needs_jax
@pytest.mark.parametrize("what", ["spot", "throughput", "mtf", "trace"])
def test_jax_has_the_derivatives_of_differences(double_gauss, what):
    import jax

    jax.config.update("jax_enable_x64", True)
    from aplanat import jax as optics

    def function(values):
        arrays = dict(zip(NAMES, values, strict=True))
        if what == "trace":
            points, directions, opl, _ = optics.trace(double_gauss, arrays, *rays())
            return (points**2).sum() + directions[:, 1].sum() + 0.1 * opl.sum()
        frequency = (20.0,) if what == "mtf" else ()
        return getattr(optics, what)(double_gauss, arrays, *frequency)

    values = np.array([double_gauss[name] for name in NAMES])
    slopes = np.asarray(jax.jit(jax.grad(function))(values))
    for i, slope in enumerate(slopes):
        step = np.zeros(len(NAMES))
        step[i] = 1e-6
        difference = float(function(values + step) - function(values - step)) / 2e-6
        assert slope == pytest.approx(difference, rel=1e-3, abs=1e-6 * np.abs(slopes).max())


@needs_torch
def test_torch_refuses_what_it_does_not_differentiate(double_gauss):
    import torch

    from aplanat import torch as optics

    value = torch.tensor(double_gauss[NAMES[0]], dtype=torch.float64, requires_grad=True)
    spot = optics.spot(double_gauss, {NAMES[0]: value})
    (slope,) = torch.autograd.grad(spot, value, create_graph=True)
    with pytest.raises(RuntimeError):
        torch.autograd.grad(slope, value)
    points, directions = rays()
    with pytest.raises(aplanat.InputError, match="require a gradient"):
        optics.trace(double_gauss, {}, torch.tensor(points, requires_grad=True), directions)


@needs_torch
def test_torch_evaluates_a_lens_as_it_is(double_gauss):
    from aplanat import torch as optics

    whole = optics.spot(double_gauss, {NAMES[0]: double_gauss[NAMES[0]]})
    assert float(optics.spot(double_gauss, {})) == pytest.approx(float(whole), rel=1e-12)
    assert bool(optics.trace(double_gauss, {}, *rays())[3].all())


@needs_jax
def test_jax_evaluates_a_lens_as_it_is(double_gauss):
    from aplanat import jax as optics

    whole = optics.spot(double_gauss, {NAMES[0]: double_gauss[NAMES[0]]})
    assert float(optics.spot(double_gauss, {})) == pytest.approx(float(whole), rel=1e-6)
