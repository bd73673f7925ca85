"""Optimizes a lens together with a small network that takes the distortion out of its pictures.

Rays of random directions go through random points of the pupil; the network maps the points at which they
land back to their directions. Sharp spots and a network that knows the distortion both lower the loss, so
the lens need not be corrected for what the network can undo.
"""

import time

import numpy as np
import torch

import aplanat
from aplanat import torch as optics

STEPS, RAYS = 200, 2048


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


def main() -> None:
    torch.manual_seed(1)
    lens = aplanat.Lens.bundled("double_gauss_rudolph_50")
    first_order = aplanat.info(lens)
    names = [name for name in lens.names() if name.startswith("curvature")]
    numbers = {name: torch.tensor(lens[name], dtype=torch.float64, requires_grad=True) for name in names}
    network = torch.nn.Sequential(
        torch.nn.Linear(2, 32), torch.nn.Tanh(), torch.nn.Linear(32, 2)
    ).double()
    optimizer = torch.optim.Adam(
        [
            {"params": network.parameters(), "lr": 3e-3},
            {"params": list(numbers.values()), "lr": 1e-5},
        ]
    )
    begin = time.perf_counter()
    for step in range(STEPS):
        points, directions = random_rays(first_order.entrance_pupil, 14.0, step)
        landed, _, _, imaged = optics.trace(lens, numbers, points, directions)
        target = torch.as_tensor(directions[:, :2] / directions[:, 2:])
        # The network adds what the lens itself does not do: an image height of f times the slope.
        heights = landed[:, :2] / first_order.efl
        error = (heights + 0.01 * network(heights) - target)[imaged]
        loss = (first_order.efl * error).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if step % 20 == 0 or step == STEPS - 1:
            print(f"step {step:3}: {1e3 * loss.sqrt().item():.2f} µm")
    print(f"{1e3 * (time.perf_counter() - begin) / STEPS:.2f} ms a step of {RAYS} rays")


if __name__ == "__main__":
    main()
