"""Meshes that the tests share."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def box_file():
    return ROOT / "assets/box/Box.glb"


@pytest.fixture(scope="session")
def box():
    return trimesh.creation.box((2, 3, 4))


@pytest.fixture(scope="session")
def spot():
    """A closed, curved mesh that comes with the sources."""
    return trimesh.load(ROOT / "assets/spot/spot.obj", force="mesh", process=True, maintain_order=True)


@pytest.fixture(scope="session")
def bunny_file():
    """The Stanford bunny, where the folder of public models is at hand."""
    shared = Path(os.environ.get("FIRSTHIT_SHARED", ROOT.parent / "shared"))
    file = shared / "assets/stanford-bunny/stanford-bunny.obj"
    if not file.exists():
        if os.environ.get("FIRSTHIT_REQUIRE_SHARED") == "1":
            pytest.fail("no folder of public data")
        pytest.skip("no folder of public data (FIRSTHIT_SHARED names it)")
    return file


@pytest.fixture(scope="session")
def bunny(bunny_file):
    return trimesh.load(bunny_file, process=False)


def random_rays(mesh, count, seed=1):
    """Rays from a sphere around a mesh to points in its box."""
    rng = np.random.default_rng(seed)
    low, high = mesh.bounds
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    origins = rng.normal(size=(count, 3))
    origins = middle + size * origins / np.linalg.norm(origins, axis=1, keepdims=True)
    return origins, rng.uniform(low, high, size=(count, 3)) - origins
