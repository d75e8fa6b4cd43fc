"""Nearest points, distances, inside and outside."""

import numpy as np
import pytest
import trimesh

import firsthit

SIGNS = ["auto", "winding", "fast_winding", "parity", "pseudonormal", "exact"]


def random_points(mesh, count, seed=5):
    low, high = mesh.bounds
    return np.random.default_rng(seed).uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), size=(count, 3))


@pytest.fixture(scope="module")
def scene(spot):
    return firsthit.Scene(spot)


@pytest.fixture(scope="module")
def points(spot):
    return random_points(spot, 4000)


def test_nearest_points_are_those_of_trimesh(spot, scene, points):
    nearest = scene.closest_point(points)
    theirs, distance, _ = trimesh.proximity.closest_point(spot, points)
    # Now and then trimesh takes a triangle that is not the nearest; ours is never farther.
    assert np.sum(np.abs(nearest.distance - distance) > 1e-6) < 4
    assert np.max(nearest.distance - distance) < 1e-6
    assert np.allclose(np.linalg.norm(nearest.points - points, axis=1), nearest.distance)
    assert np.mean(np.linalg.norm(nearest.points - theirs, axis=1) < 1e-5) > 0.99
    corners = spot.vertices[spot.faces[nearest.primitive_ids]]
    u, v = nearest.primitive_uvs.T[..., None].astype("f8")
    weighed = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    assert np.abs(weighed - nearest.points).max() < 1e-6
    assert np.array_equal(scene.distance(points), nearest.distance)


def test_furthest_points_are_vertices(spot, scene, points):
    furthest = scene.furthest_point(points)
    used = spot.vertices[np.unique(spot.faces)]
    distances = np.linalg.norm(points[:, None] - used[None], axis=2)
    assert np.abs(furthest.distance - distances.max(axis=1)).max() < 1e-6
    corners = spot.vertices[spot.faces[furthest.primitive_ids]]
    corner = np.argmax([np.ones(len(points)) - furthest.primitive_uvs.sum(axis=1), *furthest.primitive_uvs.T], axis=0)
    assert np.abs(corners[np.arange(len(points)), corner] - furthest.points).max() < 1e-6
    one = scene.furthest_point(points[7], threads=1)
    assert all(np.array_equal(one[key], furthest[key][7]) for key in furthest.keys())
    assert scene.furthest_point([np.nan, 0, 0]).primitive_ids == firsthit.INVALID_ID


def test_shapes_and_types(scene, points):
    for shape in [(), (0,), (7,), (4, 10, 100)]:
        p = points[: int(np.prod(shape))].reshape(*shape, 3)
        nearest = scene.closest_point(p)
        assert nearest.shape == nearest.distance.shape == nearest.primitive_ids.shape == shape
        assert nearest.points.shape == nearest["primitive_normals"].shape == (*shape, 3)
        assert set(dict(nearest)) == set(nearest.keys()) and "t_hit" not in nearest.keys()
        assert scene.distance(p).shape == scene.winding_number(p).shape == shape
        assert scene.contains(p).dtype == bool and scene.contains(p).shape == shape
    for ask in (scene.closest_point, scene.distance, scene.signed_distance, scene.contains):
        with pytest.raises(ValueError, match="is needed"):
            ask(np.zeros((4, 2)))
    with pytest.raises(ValueError, match="sign"):
        scene.contains(points, sign="guess")
    assert np.isnan(scene.distance([np.nan, 0, 0])) and not scene.contains([np.nan, 0, 0])
    assert scene.closest_point([np.nan, 0, 0]).primitive_ids == firsthit.INVALID_ID


def test_one_alone_and_many_on_threads_are_the_same_bits(scene, points):
    whole = scene.closest_point(points)
    for threads in (1, 3):
        again = scene.closest_point(points, threads=threads)
        assert all(np.array_equal(again[key], whole[key]) for key in whole.keys())
        assert np.array_equal(scene.signed_distance(points), scene.signed_distance(points, threads=threads))
    for i in range(0, 4000, 37):
        one = scene.closest_point(points[i])
        assert all(np.array_equal(one[key], whole[key][i]) for key in whole.keys())


def test_radius(scene, points):
    distance = scene.distance(points)
    near = scene.closest_point(points, radius=0.2)
    assert np.array_equal(np.isfinite(near.distance), distance <= 0.2)
    assert np.isnan(near.points[distance > 0.2]).all()
    radii = np.where(np.arange(4000) % 2 == 0, distance * 1.01, distance * 0.99)
    each = scene.closest_point(points, radius=radii)
    assert np.array_equal(np.isfinite(each.distance), np.arange(4000) % 2 == 0)


@pytest.mark.parametrize("sign", SIGNS)
def test_inside_is_what_trimesh_says(spot, scene, points, sign):
    assert scene.is_watertight()
    inside = scene.contains(points, sign=sign)
    assert np.array_equal(inside, firsthit.trimesh_ray(spot).contains_points(points))
    assert (inside != spot.contains(points)).sum() <= 2
    signed = scene.signed_distance(points, sign=sign)
    assert np.array_equal(np.abs(signed), scene.distance(points))
    assert np.array_equal(signed < 0, inside)


def test_a_box(box):
    scene = firsthit.Scene(box)
    points = np.random.default_rng(2).uniform(-3, 3, size=(5000, 3))
    beyond = np.abs(points) - [1, 1.5, 2]
    exact = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    for sign in SIGNS:
        assert np.allclose(scene.signed_distance(points, sign=sign), exact, atol=1e-12), sign
    assert np.array_equal(scene.winding_number(points), (exact < 0).astype(float))


def test_holes_do_not_upset_the_winding_number(box):
    open_box = trimesh.Trimesh(box.vertices, box.faces[:-1], process=False)
    scene = firsthit.Scene(open_box)
    assert not scene.is_watertight()
    assert scene.contains([0.0, 0, 0]) and not scene.contains([5.0, 0, 0])
    assert 0.5 < scene.winding_number([0.0, 0, 0]) < 1
