"""What scenes are made of, and what is refused."""

import os
import pickle
import time

import numpy as np
import pytest
import trimesh

import firsthit
from conftest import ROOT, random_rays

TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize("dtype", ["int32", "int64", "uint32", "uint8"])
@pytest.mark.parametrize("floats", ["float32", "float64", "int64"])
def test_arrays_of_any_type(dtype, floats):
    scene = firsthit.Scene(np.array(TRIANGLE[0], floats), np.array(TRIANGLE[1], dtype))
    assert scene.closest_hit([0.25, 0.25, 5], [0, 0, -1]).t_hit == 5


def test_strided_arrays(spot):
    vertices = np.repeat(spot.vertices, 2, axis=0)[::2]
    faces = np.asfortranarray(spot.faces[:, ::-1])[:, ::-1]
    assert not vertices.flags.c_contiguous and not faces.flags.c_contiguous
    a, b = firsthit.Scene(vertices, faces), firsthit.Scene(spot)
    rays = np.concatenate(random_rays(spot, 1000), axis=1)
    assert np.array_equal(a.closest_hit(rays).primitive_ids, b.closest_hit(np.asfortranarray(rays)).primitive_ids)
    narrow = rays.astype("f4")
    assert np.array_equal(a.closest_hit(narrow).t_hit, a.closest_hit(narrow.astype("f8")).t_hit)
    assert np.array_equal(a.closest_hit(rays[::2]).t_hit, a.closest_hit(rays).t_hit[::2])


def packed(numbers, dtype):
    """The same array as a field of records of odd size: nothing in it is aligned."""
    numbers = np.asarray(numbers, dtype)
    records = np.zeros(len(numbers), np.dtype([("tag", "u1"), ("numbers", dtype, numbers.shape[1:])]))
    records["numbers"] = numbers
    assert not records["numbers"].flags.aligned
    return records["numbers"]


@pytest.mark.parametrize("dtype", ["int32", "int64", "uint32"])
@pytest.mark.parametrize("floats", ["float32", "float64"])
def test_unaligned_arrays(dtype, floats):
    scene = firsthit.Scene(packed(TRIANGLE[0], floats), packed(TRIANGLE[1], dtype))
    assert scene.closest_hit(packed([[0.25, 0.25, 5]], floats), packed([[0, 0, -1]], floats)).t_hit == 5
    # In order, but from an odd byte on.
    whole = np.zeros(1 + 3 * np.dtype(dtype).itemsize, "u1")[1:].view(dtype).reshape(1, 3)
    whole[:] = TRIANGLE[1]
    assert whole.flags.c_contiguous and not whole.flags.aligned
    assert firsthit.Scene(TRIANGLE[0], whole).stats["stored_triangles"] == 1


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted by Linux")
def test_few_pools_are_kept():
    scene = firsthit.Scene(*TRIANGLE)
    before = len(os.listdir("/proc/self/task"))
    for threads in range(11, 41):
        assert scene.closest_hit(np.tile([0.25, 0.25, 5, 0, 0, -1.0], (5000, 1)), threads=threads).hit.all()
    # Threads take a moment to end. Three pools are left.
    deadline = time.monotonic() + 20
    while (kept := len(os.listdir("/proc/self/task")) - before) > 38 + 39 + 40 and time.monotonic() < deadline:
        time.sleep(0.05)
    assert kept <= 38 + 39 + 40


def test_objects_with_triangles(spot):
    class Legacy:
        vertices, triangles = spot.vertices, spot.faces

    rays = random_rays(spot, 100)
    expected = firsthit.Scene(spot.vertices, spot.faces).closest_hit(*rays).t_hit
    for mesh in (spot, Legacy()):
        assert np.array_equal(firsthit.Scene(mesh).closest_hit(*rays).t_hit, expected)


def test_far_from_the_origin_nothing_is_lost():
    middle = np.array([6.4e6, -3.1e6, 1.0])
    ball = trimesh.creation.icosphere(subdivisions=2)
    origins, directions = random_rays(ball, 5000)
    near = firsthit.Scene(ball).closest_hit(origins, directions)
    far = firsthit.Scene(ball.vertices + middle, ball.faces).closest_hit(origins + middle, directions)
    same = near.primitive_ids == far.primitive_ids
    assert same.mean() > 0.999
    both = same & near.hit
    assert np.abs(near.t_hit[both] - far.t_hit[both]).max() < 1e-6


def test_files(box_file):
    scene = firsthit.load(box_file)
    assert scene.warnings == [] and scene.precision == "robust"
    assert np.array_equal(scene.bounds, [[-0.5] * 3, [0.5] * 3])
    assert scene.stats["stored_triangles"] == 12
    assert scene.closest_hit([0, 0, 2], [0, 0, -1]).t_hit == 1.5
    assert firsthit.load(str(box_file), precision="exact").precision == "exact"


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        ([[0, 0, 0], [1, 0, 0]], [[0, 1, 2]], "vertex 2 does not exist"),
        (TRIANGLE[0], [[0, 1, -1]], "triangle 0: vertex -1 does not exist"),
        (TRIANGLE[0], [[0, 1, 2**40]], "does not exist"),
        (TRIANGLE[0], [[0.0, 1.0, 2.0]], "integers"),
        (TRIANGLE[0], [0, 1, 2], "(n, 3) is needed"),
        (np.zeros((3, 2)), TRIANGLE[1], "(n, 3) is needed"),
        ([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], TRIANGLE[1], "vertex 0 is not finite"),
        (np.array([[0, 0, 0], [1, 0, np.inf], [0, 1, 0]], "f4"), TRIANGLE[1], "vertex 1 is not finite"),
        ([[0, 0, 0], [1, 0]], TRIANGLE[1], ""),
        (TRIANGLE[0], None, "vertices and triangles are needed"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices, triangles, words):
    with pytest.raises(ValueError) as error:
        firsthit.Scene(vertices, triangles)
    assert words in str(error.value)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="none.glb"):
        firsthit.load(tmp_path / "none.glb")
    broken = tmp_path / "broken.obj"
    broken.write_text("v 1 2\nf 1 2 3\n")
    with pytest.raises(ValueError, match="broken.obj"):
        firsthit.load(broken)
    for options in ({"precision": "good"}, {"quality": "best"}, {"up": "+W"}, {"threads": 5000}):
        with pytest.raises(ValueError):
            firsthit.load(ROOT / "assets/box/Box.glb", **options)


def test_an_empty_scene_is_one():
    scene = firsthit.Scene([], [])
    assert not scene.closest_hit([0, 0, 0], [0, 0, 1]).hit


@pytest.mark.parametrize("precision", ["fast", "robust", "double", "exact"])
def test_pickles_answer_the_same(spot, box_file, precision):
    origins, directions = random_rays(spot, 2000)
    scenes = [
        firsthit.Scene(spot, precision=precision, quality="fast"),
        firsthit.Scene(spot.vertices + 1e6, spot.faces, precision=precision),
        firsthit.load(box_file, precision=precision),
    ]
    for scene, shift in zip(scenes, (0, 1e6, 0)):
        copy = pickle.loads(pickle.dumps(scene))
        assert copy.precision == precision
        a, b = (s.closest_hit(origins + shift, directions) for s in (scene, copy))
        assert a.hit.any()
        for key in a.keys():
            assert np.array_equal(a[key], b[key])
