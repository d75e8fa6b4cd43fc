"""A slice through the signed distance of a model: `python distance.py MODEL slice.png` (needs matplotlib)."""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import firsthit

model, picture = sys.argv[1:3]
scene = firsthit.load(model)
low, high = scene.bounds
middle, half = (low + high) / 2, 0.6 * (high - low).max()
z, y = np.meshgrid(middle[2] + np.linspace(-half, half, 500), middle[1] + np.linspace(-half, half, 500))
points = np.stack([np.full_like(y, middle[0] + 0.1 * half), y, z], axis=-1)

distance = scene.signed_distance(points)  # 500 x 500

figure, axes = plt.subplots(figsize=(4.6, 3.8), layout="constrained")
most = np.abs(distance).max()
shown = axes.contourf(z, y, distance, levels=25, cmap="RdBu", vmin=-most, vmax=most)
axes.contour(z, y, distance, levels=[0], colors="black", linewidths=1.5)
figure.colorbar(shown, label="signed distance")
axes.set_aspect("equal")
axes.set_xlabel("z")
axes.set_ylabel("y")
figure.savefig(picture, dpi=80)
