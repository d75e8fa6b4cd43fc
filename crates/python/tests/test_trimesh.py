"""Beside trimesh and Embree."""

import pickle

import numpy as np
import pytest
import trimesh

import firsthit
from conftest import random_rays

embree = pytest.importorskip("trimesh.ray.ray_pyembree")
if not hasattr(embree, "RayMeshIntersector"):
    pytest.skip("no embreex", allow_module_level=True)


@pytest.fixture(params=["box", "spot", "bunny"])
def mesh(request):
    return request.getfixturevalue(request.param)


def test_first_hits_are_those_of_embree(mesh):
    rays = random_rays(mesh, 20_000)
    ours, theirs = firsthit.trimesh_ray(mesh), embree.RayMeshIntersector(mesh)
    a, b = ours.intersects_first(*rays), theirs.intersects_first(*rays)
    assert a.dtype == b.dtype or a.dtype == np.int64
    # Where two triangles meet, either may be named; a graze may be seen or not.
    differ = np.flatnonzero(a != b)
    assert len(differ) < 20, len(differ)
    assert (ours.intersects_any(*rays) != theirs.intersects_any(*rays)).sum() < 5
    assert np.array_equal(ours.intersects_any(*rays), a != -1)


def test_first_hits_are_those_of_trimesh_in_double_precision(box):
    rays = random_rays(box, 300)
    slow = trimesh.ray.ray_triangle.RayMeshIntersector(box)
    locations, rays_hit, _ = slow.intersects_location(*rays, multiple_hits=False)
    ours, ours_hit, _ = firsthit.trimesh_ray(box).intersects_location(*rays, multiple_hits=False)
    order = np.argsort(rays_hit)
    assert np.array_equal(rays_hit[order], ours_hit)
    assert np.allclose(locations[order], ours, atol=1e-9)


def test_every_crossing_is_reported_once(mesh):
    origins, directions = random_rays(mesh, 5000)
    ray = firsthit.trimesh_ray(mesh)
    locations, index_ray, index_tri = ray.intersects_location(origins, directions)
    assert locations.shape == (len(index_ray), 3) and index_tri.max() < len(mesh.faces)
    # The locations lie on the triangles that are named.
    corner, normal = mesh.triangles[index_tri, 0], mesh.face_normals[index_tri]
    assert np.abs(np.einsum("ij,ij->i", locations - corner, normal)).max() < 1e-5 * mesh.scale
    if mesh.is_watertight:
        assert not (np.bincount(index_ray) % 2).any()
    triangles, rays = ray.intersects_id(origins, directions, max_hits=1)
    first = ray.intersects_first(origins, directions)
    assert np.mean(triangles == first[rays]) > 0.999
    theirs = embree.RayMeshIntersector(mesh).intersects_id(origins, directions)
    assert abs(len(theirs[0]) - len(index_tri)) <= 0.002 * len(index_tri)


def test_points_inside(box, spot):
    for mesh in (box, spot):
        ray = firsthit.trimesh_ray(mesh)
        points = np.random.default_rng(3).uniform(*mesh.bounds * 1.1, size=(3000, 3))
        theirs = embree.RayMeshIntersector(mesh).contains_points(points)
        assert (ray.contains_points(points) != theirs).sum() <= 2
    half = np.array([1, 1.5, 2])
    points = np.random.default_rng(4).uniform(-2, 2, size=(3000, 3))
    assert np.array_equal(firsthit.trimesh_ray(box).contains_points(points), np.all(np.abs(points) < half, axis=1))


def test_it_takes_the_place_of_trimeshs(spot):
    mesh = spot.copy()
    mesh.ray = firsthit.trimesh_ray(mesh)
    inside = mesh.contains([mesh.center_mass, [9, 9, 9]])
    assert inside.tolist() == [True, False]
    before = mesh.ray.intersects_first([[0, 0, 9]], [[0, 0, -1]])
    mesh.vertices[:, 0] += 50
    assert mesh.ray.intersects_first([[0, 0, 9]], [[0, 0, -1]])[0] == -1 != before[0]
    with pytest.raises(ValueError):
        mesh.ray.intersects_first(np.zeros((2, 3)), np.zeros((3, 3)))
    copy = pickle.loads(pickle.dumps(mesh.ray))
    assert copy.intersects_any([[50, 0, 9]], [[0, 0, -1]]) == mesh.ray.intersects_any([[50, 0, 9]], [[0, 0, -1]])


def test_no_ray_leaves_a_closed_mesh(bunny):
    """Where Embree's answers leak: rays that aim exactly at edges and vertices, from inside."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    targets = np.concatenate([ball.vertices, ball.triangles[:, :2].mean(axis=1)])
    assert firsthit.trimesh_ray(ball).intersects_any(np.zeros_like(targets), targets).all()
