"""Optimizes a lens together with a small network that takes the distortion out of its pictures.

Rays of random directions go through random points of the pupil; the network maps the points at which they
land back to their directions. Sharp spots and a network that knows the distortion both lower the loss, so
the lens need not be corrected for what the network can undo.
"""

import time
from collections.abc import Callable

import numpy as np
import torch

import aplanat
from aplanat import torch as optics

NAME, STEPS, RAYS = "double_gauss_rudolph_50", 200, 2048


def random_rays(pupil: aplanat.Result, field: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in the entrance pupil, 10 mm in front of the lens, and directions up to a field angle."""
    random = np.random.default_rng(seed)
    slopes = np.tan(np.radians(field)) * random.uniform(-0.7, 0.7, (RAYS, 2))
    radius, angle = np.sqrt(random.uniform(0, 1, RAYS)), random.uniform(0, 2 * np.pi, RAYS)
    at_pupil = 0.4 * pupil.diameter * radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.full((RAYS, 3), -10.0)
    points[:, :2] = at_pupil - slopes * (pupil.position + 10.0)
    directions = np.concatenate([slopes, np.ones((RAYS, 1))], 1)
    return points, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def optimize(lens: aplanat.Lens, trace: Callable, steps: int = STEPS) -> tuple[list[float], float]:
    """The RMS errors of the steps in µm, and the seconds that a step takes. `trace` gives the points
    at which rays land, and which rays land, for some curvatures."""
    torch.manual_seed(1)
    first_order = aplanat.info(lens)
    # The stop is a plane and stays one.
    names = [name for name in lens.names() if name.startswith("curvature") and lens[name]]
    numbers = {name: torch.tensor(lens[name], dtype=torch.float64, requires_grad=True) for name in names}
    network = torch.nn.Sequential(torch.nn.Linear(2, 32), torch.nn.Tanh(), torch.nn.Linear(32, 2)).double()
    groups = [(network.parameters(), 3e-3), (list(numbers.values()), 1e-5)]
    optimizer = torch.optim.Adam([{"params": params, "lr": rate} for params, rate in groups])
    errors, begin = [], time.perf_counter()
    for step in range(steps):
        points, directions = random_rays(first_order.entrance_pupil, 14.0, step)
        landed, imaged = trace(numbers, points, directions)
        target = torch.as_tensor(directions[:, :2] / directions[:, 2:])
        # The network adds what the lens itself does not do: an image height of f times the slope.
        heights = landed[:, :2] / first_order.efl
        error = (heights + 0.01 * network(heights) - target)[imaged]
        loss = (first_order.efl * error).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        errors.append(1e3 * loss.sqrt().item())
    return errors, (time.perf_counter() - begin) / steps


def main() -> None:
    lens = aplanat.Lens.bundled(NAME)

    def trace(numbers: dict, points: np.ndarray, directions: np.ndarray) -> tuple:
        landed, _, _, imaged = optics.trace(lens, numbers, points, directions)
        return landed, imaged

    errors, seconds = optimize(lens, trace)
    print("\n".join(f"step {step:3}: {errors[step]:.2f} µm" for step in (*range(0, STEPS, 20), STEPS - 1)))
    print(f"{1e3 * seconds:.2f} ms a step of {RAYS} rays")


if __name__ == "__main__":
    main()
