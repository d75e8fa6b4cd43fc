"""Scenes that change, instances and masks."""

import pickle

import firsthit
import numpy as np
import pytest


def moved(*offsets):
    """Matrices that move by so much."""
    matrices = np.tile(np.eye(4), (len(offsets), 1, 1))
    matrices[:, :3, 3] = offsets
    return matrices


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
DOWN = [0.5, 0.25, 10, 0, 0, -1]


def bits(hits):
    return [hits[key].tobytes() for key in hits.keys()]


def test_instances_are_met_where_they_are():
    scene = firsthit.Scene(SQUARE, TRIANGLES, transforms=moved([0, 0, 0], [0, 0, 3], [5, 0, 0]))
    hit = scene.closest_hit(DOWN)
    assert (hit.t_hit, hit.instance_ids, hit.primitive_ids) == (7, 1, 0)
    assert scene.count_hits(DOWN) == 2
    assert scene.stats["stored_triangles"] == 2 and scene.stats["instanced_triangles"] == 6
    np.testing.assert_array_equal(scene.bounds, [[0, 0, 0], [6, 1, 3]])


def test_transforms_may_scale_turn_and_shear():
    rng = np.random.default_rng(1)
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    scene = firsthit.Scene(SQUARE, TRIANGLES, transforms=matrix)
    flat = firsthit.Scene(SQUARE @ matrix[:3, :3].T + matrix[:3, 3], TRIANGLES)
    rays = np.concatenate([rng.normal(size=(500, 3)) * 4, np.zeros((500, 3))], axis=1)
    rays[:, 3:] = np.array([0.5, 0.5, 0]) @ matrix[:3, :3].T + matrix[:3, 3] - rays[:, :3]
    a, b = scene.closest_hit(rays), flat.closest_hit(rays)
    assert a.hit.mean() > 0.9
    np.testing.assert_array_equal(a.hit, b.hit)
    np.testing.assert_allclose(a.t_hit, b.t_hit, rtol=1e-5)


def test_new_scenes_of_old_ones():
    scene = firsthit.Scene(SQUARE, TRIANGLES)
    two = scene.with_transforms(moved([0, 0, 1], [0, 0, 4]))
    lower = two.with_transforms(moved([0, 0, 2]))
    lifted = two.refit(SQUARE + np.float32([0, 0, 0.5]))
    assert [s.closest_hit(DOWN).t_hit for s in (scene, two, lower, lifted)] == [10, 6, 8, 5.5]
    assert [s.count_hits(DOWN) for s in (scene, two, lower, lifted)] == [1, 2, 1, 2]
    assert lifted.distance([0.5, 0.5, 0]) == 1.5
    # As if built anew, and far from the origin too, where positions are stored as seen from the middle.
    far = np.float64(SQUARE) + [1e9 + 0.125, 0, 0]
    rays = np.array(DOWN) + [1e9, 0, 0, 0, 0, 0]
    assert bits(scene.refit(far).closest_hit(rays)) == bits(firsthit.Scene(far, TRIANGLES).closest_hit(rays))
    assert scene.refit(far).closest_hit(rays).hit


def test_masks_choose_instances():
    scene = firsthit.Scene(SQUARE, TRIANGLES, transforms=moved([0, 0, 0], [0, 0, 3]), masks=[1, 2])
    assert [scene.seen_by(mask).closest_hit(DOWN).t_hit for mask in (1, 2, 3, 4)] == [10, 7, 7, np.inf]
    assert scene.seen_by(1).closest_hit(DOWN).instance_ids == 0
    assert scene.seen_by(1).with_transforms(moved([0, 0, 1], [0, 0, 2]), masks=[2, 3]).closest_hit(DOWN).t_hit == 8
    # They stay with the instances.
    assert scene.seen_by(1).with_transforms(moved([0, 0, 1], [0, 0, 2])).closest_hit(DOWN).t_hit == 9
    assert scene.with_transforms(moved([0, 0, 1], [0, 0, 2], [0, 0, 4])).seen_by(1).closest_hit(DOWN).t_hit == 6


def test_masks_of_single_calls():
    closed = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "f4")
    scene = firsthit.Scene(corners, closed, transforms=moved([0, 0, 0], [0, 0, 3]), masks=[1, 2])
    ray, point = [0.1, 0.1, 10, 0, 0, -1], [0.1, 0.1, 3.1]
    queries = [
        lambda of, **mask: of.closest_hit(ray, **mask).t_hit,
        lambda of, **mask: of.closest_hits(ray, **mask).t_hit,
        lambda of, **mask: of.any_hit(ray, **mask),
        lambda of, **mask: of.count_hits(ray, crossings="surfaces", **mask),
        lambda of, **mask: of.all_hits([ray], **mask).t_hit.tolist(),
        lambda of, **mask: of.closest_point(point, **mask).distance,
        lambda of, **mask: of.distance(point, **mask),
        lambda of, **mask: of.signed_distance(point, **mask),
        lambda of, **mask: of.contains(point, **mask),
        lambda of, **mask: of.winding_number(point, **mask),
    ]
    # More masks than are kept, twice.
    for mask in [*range(12), *range(12)]:
        for query in queries:
            assert query(scene, mask=mask) == query(scene.seen_by(mask)), mask
            assert query(scene.seen_by(2), mask=mask) == query(scene.seen_by(mask)), mask
    assert [scene.contains(point, mask=mask) for mask in (None, 1, 2, 4)] == [True, False, True, False]
    with pytest.raises((OverflowError, TypeError)):
        scene.any_hit(ray, mask=-1)


def test_pictures_show_what_the_mask_sees():
    camera = dict(width=8, height=8, samples=1, position=(0.5, 0.5, 0.5), focal_point=(0.5, 0.5, 0), view_up=(0, 1, 0), transparent=True)
    scene = firsthit.Scene(SQUARE, TRIANGLES, transforms=moved([0, 0, 0], [9, 0, 0]), masks=[1, 2])
    alpha = [firsthit.render(scene.seen_by(mask), **camera)[4, 4, 3] for mask in (3, 1, 2)]
    assert alpha == [255, 255, 0]


@pytest.mark.parametrize("mask", [1, 3])
def test_they_are_pickled(mask):
    scene = firsthit.Scene(SQUARE, TRIANGLES, transforms=moved([0, 0, 0], [0, 0, 3]), masks=[1, 2]).seen_by(mask)
    again = pickle.loads(pickle.dumps(scene))
    rays = np.random.default_rng(2).uniform(-1, 2, (100, 6))
    assert bits(again.closest_hit(rays)) == bits(scene.closest_hit(rays))


def test_what_does_not_fit_is_an_error():
    scene = firsthit.Scene(SQUARE, TRIANGLES)
    for change, words in [
        (lambda: scene.refit(SQUARE[:3]), "4 vertices, 3 are given"),
        (lambda: scene.refit(SQUARE * np.nan), "not finite"),
        (lambda: scene.with_transforms(np.eye(3)), r"\(n, 4, 4\) is needed"),
        (lambda: scene.with_transforms(np.zeros((4, 4))), "last row"),
        (lambda: scene.with_transforms(np.diag([1, 1, 0, 1])), "instance 0"),
        (lambda: scene.with_transforms(moved([np.nan, 0, 0])), "instance 0"),
        (lambda: scene.with_transforms(np.eye(4), masks=[1, 2]), "2 masks for 1 instances"),
        (lambda: scene.with_transforms(np.eye(4), masks=[-1]), "numbers from 0"),
    ]:
        with pytest.raises(ValueError, match=words):
            change()
