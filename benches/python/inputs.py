"""Meshes, rays and points, the same for every engine: in single precision, which all of them take."""

import io
import pathlib

import numpy as np
import trimesh


def load(path):
    """A mesh as it stands in its file: also compressed by zstd. Vertices are rounded to single precision."""
    path = pathlib.Path(path)
    if path.suffix == ".zst":
        import zstandard

        data = zstandard.ZstdDecompressor().stream_reader(path.open("rb")).read()
        mesh = trimesh.load(io.BytesIO(data), file_type=path.suffixes[-2][1:], force="mesh", process=False)
    else:
        mesh = trimesh.load(path, force="mesh", process=False)
    mesh = trimesh.Trimesh(mesh.vertices.astype("f4"), mesh.faces, process=False)
    return path.name.split(".")[0], mesh


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def size(mesh):
    return np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])


def camera(mesh, count):
    """A square picture, row by row."""
    side = int(np.sqrt(count))
    x, y = np.meshgrid(np.linspace(-0.35, 0.35, side), np.linspace(0.35, -0.35, side))
    directions = np.stack([x, y, np.full_like(x, -1)], axis=-1).reshape(-1, 3)
    origins = np.broadcast_to(mesh.bounds.mean(axis=0) + [0, 0, size(mesh)], directions.shape)
    return np.concatenate([origins, unit(directions)], axis=1).astype("f4")


def incoherent(mesh, count):
    """From a sphere around the mesh to points in its box."""
    rng = np.random.default_rng(1)
    origins = mesh.bounds.mean(axis=0) + size(mesh) * unit(rng.normal(size=(count, 3)))
    directions = rng.uniform(*mesh.bounds, size=(count, 3)) - origins
    return np.concatenate([origins, unit(directions)], axis=1).astype("f4")


def aimed(mesh, count):
    """From the sphere exactly at corners and at middles of edges."""
    rng = np.random.default_rng(2)
    triangles = mesh.triangles[rng.integers(len(mesh.faces), size=count)]
    targets = np.where(rng.random((count, 1)) < 0.5, triangles[:, 0], (triangles[:, 0] + triangles[:, 1]) / 2)
    origins = (mesh.bounds.mean(axis=0) + size(mesh) * unit(rng.normal(size=(count, 3)))).astype("f4")
    return np.concatenate([origins, targets - origins], axis=1).astype("f4")


def volume(mesh, count):
    """In the box, enlarged by a fifth."""
    rng = np.random.default_rng(3)
    middle, half = mesh.bounds.mean(axis=0), (mesh.bounds[1] - mesh.bounds[0]) / 2
    return (middle + rng.uniform(-1.2, 1.2, size=(count, 3)) * half).astype("f4")


def near(mesh, count):
    """Off the surface by 0.2 % of the size, or so."""
    rng = np.random.default_rng(4)
    triangles = mesh.triangles[rng.integers(len(mesh.faces), size=count)]
    weights = rng.dirichlet([1, 1, 1], size=count)
    on = (triangles * weights[..., None]).sum(axis=1)
    return (on + rng.normal(size=on.shape) * 0.002 * size(mesh)).astype("f4")


RAYS = {"camera": camera, "incoherent": incoherent}
POINTS = {"volume": volume, "near": near}
