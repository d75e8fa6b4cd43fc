"""A depth map and a picture of normals: `python depth.py MODEL depth.png` (needs matplotlib)."""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import firsthit

model, picture = sys.argv[1:3]
scene = firsthit.load(model)
low, high = scene.bounds
middle, size = (low + high) / 2, np.linalg.norm(high - low)

eye = middle + size * np.array([0.5, 0.35, -1.0])
rays = firsthit.camera_rays(600, 600, position=eye, focal_point=middle, view_angle=37.6)
hits = scene.closest_hit(rays)
depth = np.where(hits.hit, hits.t_hit, np.nan)

figure, (a, b) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
shown = a.imshow(depth, cmap="viridis_r")
figure.colorbar(shown, ax=a, location="left", label="depth")
b.imshow(np.where(hits.hit[..., None], (hits.primitive_normals + 1) / 2, 1.0))
for axes, title in ((a, "scene.closest_hit(...).t_hit"), (b, "...primitive_normals")):
    axes.set_title(title, fontsize=10)
    axes.axis("off")
figure.savefig(picture, dpi=70)
