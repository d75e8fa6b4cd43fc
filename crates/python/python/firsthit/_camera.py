"""The rays of a camera's pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def camera_rays(
    width: int,
    height: int,
    *,
    position: Sequence[float],
    focal_point: Sequence[float],
    view_up: Sequence[float] = (0.0, 1.0, 0.0),
    view_angle: float = 30.0,
    orthographic_height: float | None = None,
) -> NDArray[np.float64]:
    """One ray through the middle of each pixel: an array of shape ``(height, width, 6)``, the upper left pixel first.

    ``view_angle`` is the full vertical angle in degrees. With ``orthographic_height`` the rays are parallel, and the picture
    is so high, in world units. Directions of a perspective camera reach the plane through ``position`` plus one unit of the
    line of sight, so ``t_hit`` is the depth along that; those of an orthographic one are unit.

    >>> rays = camera_rays(2, 2, position=[0, 0, 5], focal_point=[0, 0, 0], view_angle=90)
    >>> rays[0, 0].round(6).tolist()
    [0.0, 0.0, 5.0, -0.5, 0.5, -1.0]
    """
    if width < 1 or height < 1:
        raise ValueError(f"a picture of {width} x {height} has no pixels")
    eye = np.asarray(position, dtype=float)
    forward = np.asarray(focal_point, dtype=float) - eye
    right = np.cross(forward, np.asarray(view_up, dtype=float))
    lengths = np.linalg.norm(forward), np.linalg.norm(right)
    if not (np.isfinite(lengths).all() and min(lengths) > 0):
        raise ValueError("position, focal_point and view_up give no direction")
    forward, right = forward / lengths[0], right / lengths[1]
    up = np.cross(right, forward)
    across = (2 * np.arange(width) + 1 - width)[None, :, None] / height
    upwards = (height - 1 - 2 * np.arange(height))[:, None, None] / height
    rays = np.empty((height, width, 6))
    if orthographic_height is None:
        if not 0 < view_angle < 180:
            raise ValueError(f"view_angle={view_angle}: it lies between 0 and 180 degrees")
        slope = np.tan(np.radians(view_angle) / 2)
        rays[..., :3] = eye
        rays[..., 3:] = forward + right * (across * slope) + up * (upwards * slope)
    else:
        half = orthographic_height / 2
        if not (np.isfinite(half) and half > 0):
            raise ValueError(f"orthographic_height={orthographic_height}: it is above 0")
        rays[..., :3] = eye + right * (across * half) + up * (upwards * half)
        rays[..., 3:] = forward
    return rays
