"""Answers: their shapes and types, and that they do not depend on how they are asked for."""

import multiprocessing
import threading

import numpy as np
import pytest

import firsthit
from conftest import random_rays

PRECISIONS = ["fast", "robust", "double", "exact"]


@pytest.fixture(scope="module")
def scene(spot):
    return firsthit.Scene(spot)


@pytest.fixture(scope="module")
def rays(spot):
    return random_rays(spot, 5000)


def test_types_and_shapes(scene, rays):
    origins, directions = rays
    for shape in [(), (1,), (0,), (7,), (2, 3, 4), (50, 100)]:
        count = int(np.prod(shape))
        o, d = origins[:count].reshape(*shape, 3), directions[:count].reshape(*shape, 3)
        hits = scene.closest_hit(o, d)
        assert hits.shape == shape
        for key, dtype, last in [
            ("t_hit", "f8", ()),
            ("instance_ids", "u4", ()),
            ("geometry_ids", "u4", ()),
            ("primitive_ids", "u4", ()),
            ("primitive_uvs", "f4", (2,)),
            ("primitive_normals", "f8", (3,)),
        ]:
            assert hits[key].shape == shape + last and hits[key].dtype == np.dtype(dtype)
            assert hits[key] is getattr(hits, key), "made once"
        assert set(dict(hits)) == set(hits.keys())
        assert scene.any_hit(o, d).shape == shape and scene.any_hit(o, d).dtype == bool
        assert scene.count_hits(o, d).shape == shape and scene.count_hits(o, d).dtype == np.uint32
        lists = scene.all_hits(o, d)
        assert lists.shape == shape and lists.ray_splits.shape == (count + 1,)
        assert np.array_equal(np.diff(lists.ray_splits), scene.count_hits(o, d).ravel())
    with pytest.raises(KeyError):
        hits["t"]


def test_misses(scene):
    hits = scene.closest_hit([9, 9, 9], [1, 0, 0])
    assert hits.t_hit == np.inf and not hits.hit
    assert hits.primitive_ids == hits.geometry_ids == hits.instance_ids == firsthit.INVALID_ID
    assert not hits.primitive_normals.any() and not hits.primitive_uvs.any()
    nan = scene.closest_hit([[np.nan, 0, 0], [0, 0, 9], [0, 0, 9]], [[0, 0, 1], [0, 0, 0], [np.inf, 0, 0]])
    assert not nan.hit.any()


@pytest.mark.parametrize("precision", PRECISIONS)
def test_one_ray_alone_and_many_on_threads_are_the_same_bits(spot, rays, precision):
    scene = firsthit.Scene(spot, precision=precision)
    origins, directions = rays
    batch = scene.closest_hit(origins, directions)
    assert batch.hit.sum() > 1000
    if precision != "fast":  # of `fast`, packets may differ at the very edges of boxes
        singles = [scene.closest_hit(o, d) for o, d in zip(origins[:1500], directions)]
        for key in batch.keys():
            assert np.array_equal(batch[key][:1500], [s[key] for s in singles]), key
        assert np.array_equal(scene.any_hit(origins, directions), batch.hit)
    for threads in (1, 2, 5):
        again = scene.closest_hit(origins, directions, threads=threads)
        for key in batch.keys():
            assert np.array_equal(batch[key], again[key]), key
    lists = scene.all_hits(origins, directions, threads=3)
    assert np.array_equal(lists.ray_ids, np.repeat(np.arange(5000), np.diff(lists.ray_splits)))
    for i in range(0, 5000, 501):
        one = scene.all_hits(origins[i], directions[i])
        part = slice(lists.ray_splits[i], lists.ray_splits[i + 1])
        assert np.array_equal(one.t_hit, lists.t_hit[part]) and np.all(np.diff(one.t_hit) >= 0)
    if precision != "fast":
        firsts = lists.ray_splits[:-1][batch.hit]
        assert np.array_equal(lists.t_hit[firsts], batch.t_hit[batch.hit])
        assert np.array_equal(lists.primitive_ids[firsts], batch.primitive_ids[batch.hit])


def test_every_way_to_give_rays(scene, rays):
    origins, directions = rays
    expected = scene.closest_hit(origins, directions).t_hit
    together = np.concatenate(rays, axis=1)
    interval = np.broadcast_to([0, np.inf], (5000, 2))
    assert np.array_equal(scene.closest_hit(together).t_hit, expected)
    assert np.array_equal(scene.closest_hit(np.concatenate([together, interval], axis=1)).t_hit, expected)
    assert np.array_equal(scene.closest_hits(rays=together.tolist()).t_hit, expected)
    # Repeated as NumPy does.
    eye, grid = [0.0, 0.0, 5.0], directions[:600].reshape(20, 30, 3)
    whole = scene.closest_hit(np.broadcast_to(eye, grid.shape), grid).t_hit
    assert np.array_equal(scene.closest_hit(eye, grid).t_hit, whole)
    columns = scene.closest_hit(origins[:20, None], directions[None, :30])
    assert columns.shape == (20, 30)
    assert columns.t_hit[3, 4] == scene.closest_hit(origins[3], directions[4]).t_hit


def test_intervals(scene, rays):
    origins, directions = rays
    first = scene.closest_hit(origins, directions)
    hit = first.hit
    beyond = np.where(hit, first.t_hit * 1.0001 + 1e-9, 0)
    second = scene.closest_hit(origins, directions, t_min=beyond)
    assert np.all(second.t_hit[hit] > first.t_hit[hit])
    assert not scene.any_hit(origins, directions, t_max=np.where(hit, first.t_hit * 0.9999, 1e9)).any()
    assert np.array_equal(scene.any_hit(origins, directions, t_min=0, t_max=1e9), hit)
    eight = np.column_stack([origins, directions, beyond, np.full(5000, np.inf)])
    assert np.array_equal(scene.closest_hit(eight).t_hit, second.t_hit)
    rows = scene.any_hit(origins[:6].reshape(2, 3, 3), directions[:6].reshape(2, 3, 3), t_max=[[0], [1e9]])
    assert not rows[0].any() and np.array_equal(rows[1], hit[3:6])


def test_surfaces_are_crossed_an_even_number_of_times(scene, spot):
    assert spot.is_watertight
    # Through vertices and edges, from far outside.
    targets = np.concatenate([spot.vertices[:500], spot.triangles[:500, :2].mean(axis=1)])
    origins = np.array([3.0, 4.0, 5.0])
    counts = scene.count_hits(origins, targets - origins, crossings="surfaces")
    assert not (counts % 2).any()
    lists = scene.all_hits(origins, targets - origins, crossings="surfaces")
    assert np.array_equal(np.diff(lists.ray_splits), counts)


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (([0, 0, 0],), {}, "(..., 6)"),
        ((np.zeros((4, 7)),), {}, "(4, 7)"),
        ((np.zeros((4, 3)), np.zeros((5, 3))), {}, "do not fit"),
        ((np.zeros((4, 3)), np.zeros((4, 2))), {}, "(..., 3)"),
        ((1.0, 2.0), {}, "(..., 3)"),
        ((np.zeros((4, 6)),), {"t_max": [1, 2, 3]}, ""),
        ((np.zeros((4, 8)),), {"t_max": 1}, "of their own"),
        ((["a"] * 6,), {}, ""),
        ((np.zeros((4, 6)),), {"threads": 10**6}, "threads"),
    ],
)
def test_what_are_no_rays_is_refused(scene, arguments, options, words):
    if "threads" in options:
        arguments = (np.zeros((5000, 6)),)
    for ask in (scene.closest_hit, scene.any_hit, scene.count_hits, scene.all_hits):
        with pytest.raises(ValueError) as error:
            ask(*arguments, **options)
        assert words in str(error.value).replace("[", "(").replace("]", ")")
    with pytest.raises(ValueError, match="crossings"):
        scene.count_hits(np.zeros(6), crossings="edges")
    with pytest.raises((TypeError, OverflowError)):
        scene.any_hit(np.zeros(6), threads=-1)


def test_many_python_threads_may_ask(scene, rays):
    expected = scene.closest_hit(*rays).t_hit
    answers = [None] * 8

    def ask(i):
        answers[i] = scene.closest_hit(*rays).t_hit

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, expected) for a in answers)


def _ask(scene, rays, queue):
    queue.put(scene.closest_hit(*rays).t_hit)


def test_a_forked_process_may_ask(scene, rays):
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    expected = scene.closest_hit(*rays, threads=2).t_hit  # the threads are there, and are not in the child
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_ask, args=(scene, rays, queue))
    child.start()
    try:
        assert np.array_equal(queue.get(timeout=60), expected)
        child.join(timeout=60)
        assert child.exitcode == 0
    finally:
        child.kill()
