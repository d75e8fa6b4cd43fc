"""Rays of a camera's pixels."""

import doctest

import numpy as np
import pytest

import firsthit
from firsthit import _camera


def test_the_example():
    assert doctest.testmod(_camera).failed == 0


@pytest.mark.parametrize("size", [(40, 30), (31, 52)])
@pytest.mark.parametrize("view", [{"view_angle": 40.0}, {"orthographic_height": 1.9}])
def test_rays_see_what_pictures_show(spot, size, view):
    """Pixels whose middle meets the cow are those that are opaque in a picture, but for those at its outline."""
    width, height = size
    scene = firsthit.Scene(spot)
    camera = {"position": [1.5, 1.2, -2.5], "focal_point": [0.0, 0.1, 0.1], "view_up": [0.1, 1.0, 0.2]}
    met = scene.any_hit(firsthit.camera_rays(width, height, **camera, **view))
    assert 0.05 < met.mean() < 0.9
    if "view_angle" not in view:
        return
    shown = firsthit.render(scene, width=width, height=height, samples=16, transparent=True, **camera, **view)[..., 3]
    assert met[shown == 255].all() and not met[shown == 0].any()


def test_depths_and_directions():
    plane = firsthit.Scene([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]])
    rays = firsthit.camera_rays(8, 4, position=[0, 0, 2], focal_point=[0, 0, 0], view_angle=60)
    assert rays.shape == (4, 8, 6)
    # Depth along the line of sight is the same everywhere on a plane across it.
    assert np.allclose(plane.closest_hit(rays).t_hit, 2)
    # The first row looks upwards, the first column to the left.
    assert (rays[0, :, 4] > 0).all() and (rays[:, 0, 3] < 0).all()
    flat = firsthit.camera_rays(8, 4, position=[0, 0, 2], focal_point=[0, 0, 0], orthographic_height=4)
    assert (flat[..., 3:] == [0, 0, -1]).all()
    assert np.allclose(flat[:, 0, 1], [1.5, 0.5, -0.5, -1.5]) and np.allclose(flat[0, :2, 0], [-3.5, -2.5])


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 0},
        {"focal_point": [0, 0, 2]},
        {"view_up": [0, 0, 1]},
        {"view_angle": 180},
        {"orthographic_height": 0},
        {"position": [float("nan"), 0, 2]},
    ],
)
def test_what_is_no_camera_is_refused(wrong):
    camera = {"width": 4, "height": 4, "position": [0, 0, 2], "focal_point": [0, 0, 0]} | wrong
    with pytest.raises(ValueError):
        firsthit.camera_rays(camera.pop("width"), camera.pop("height"), **camera)
