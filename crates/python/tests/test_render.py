"""Pictures as arrays."""

import numpy as np
import pytest

import firsthit

SMALL = {"width": 48, "height": 27, "samples": 4}


def test_a_picture_of_a_file_and_of_arrays(box_file, spot):
    picture = firsthit.render(box_file, **SMALL)
    assert picture.shape == (27, 48, 4) and picture.dtype == np.uint8
    assert picture[..., :3].std() > 5
    # The box is red.
    red, green, _, _ = picture[13, 24]
    assert red > 2 * green
    assert np.array_equal(firsthit.render(firsthit.load(box_file), **SMALL), picture)
    assert np.array_equal(firsthit.render(str(box_file), **SMALL, threads=1), picture)
    scene = firsthit.Scene(spot)
    seen = firsthit.render(scene, **SMALL, transparent=True)
    assert (seen[..., 3] == 0).any() and (seen[..., 3] == 255).any()


def test_linear_values(box_file):
    """The colour that the file gives the box."""
    albedo = firsthit.render(box_file, **SMALL, integrator="albedo", linear=True)
    assert albedo.dtype == np.float32
    assert np.allclose(albedo[13, 24], [0.8, 0, 0, 1], atol=1e-6)


def test_what_is_no_picture_is_refused(box_file, tmp_path):
    with pytest.raises(FileNotFoundError):
        firsthit.render(tmp_path / "none.glb")
    with pytest.raises(TypeError):
        firsthit.render(3)
    for options in (
        {"width": 0},
        {"samples": 0},
        {"integrator": "magic"},
        {"tone_mapping": "sepia"},
        {"camera": "no such camera"},
        {"time_limit": -1.0},
    ):
        with pytest.raises(ValueError):
            firsthit.render(box_file, **{**SMALL, **options})
