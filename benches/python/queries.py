#!/usr/bin/env python3
"""Times the Python package beside Open3D and Embree (through embreex) on one core, and prints a table.

    taskset -c 1 python queries.py bunny.obj dragon.glb

The engines take turns on the same rays of 32-bit floats, each of them with its own array type made beforehand; the best
and the median of the repetitions are told, in time of the processor. Needs numpy and trimesh; open3d and embreex if they are to be measured.
"""

import argparse
import time

import numpy as np
import trimesh

import firsthit

try:
    import open3d
except ImportError:
    open3d = None
try:
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh
except ImportError:
    rtcore_scene = None


def incoherent(mesh, count):
    """From a sphere around the mesh to points in its box."""
    rng = np.random.default_rng(1)
    low, high = mesh.bounds
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    origins = rng.normal(size=(count, 3))
    origins = middle + size * origins / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(low, high, size=(count, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def camera(mesh, count):
    """A square picture, row by row."""
    side = int(np.sqrt(count))
    low, high = mesh.bounds
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    x, y = np.meshgrid(np.linspace(-0.35, 0.35, side), np.linspace(0.35, -0.35, side))
    directions = np.stack([x, y, np.full_like(x, -1)], axis=-1).reshape(-1, 3)
    origins = np.broadcast_to(middle + [0, 0, size], directions.shape)
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


class Firsthit:
    def __init__(self, name, mesh, rays, **options):
        self.name, self.rays = name, rays
        self.scene = firsthit.Scene(mesh.vertices.astype("f4"), mesh.faces, threads=1, **options)

    def closest(self):
        hits = self.scene.closest_hit(self.rays, threads=1)
        return hits.primitive_ids, hits.t_hit

    def any(self):
        return self.scene.any_hit(self.rays, threads=1)

    def count(self):
        return self.scene.count_hits(self.rays, threads=1)

    def one(self, ray):
        return lambda: self.scene.closest_hit(ray)


class Open3D:
    name = "Open3D"

    def __init__(self, mesh, rays):
        self.scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self.scene.add_triangles(mesh.vertices.astype("f4"), mesh.faces.astype("u4"))
        self.rays = open3d.core.Tensor(rays)
        self.scene.test_occlusions(self.rays[:1])  # it builds the tree when it is first asked

    def closest(self):
        hits = self.scene.cast_rays(self.rays, nthreads=1)
        return hits["primitive_ids"].numpy(), hits["t_hit"].numpy()

    def any(self):
        return self.scene.test_occlusions(self.rays, nthreads=1).numpy()

    def count(self):
        return self.scene.count_intersections(self.rays, nthreads=1).numpy()

    def one(self, ray):
        ray = open3d.core.Tensor(ray[None])
        return lambda: self.scene.cast_rays(ray)


class Embree:
    name = "embreex"

    def __init__(self, mesh, rays):
        self.scene = rtcore_scene.EmbreeScene(robust=True)
        self.mesh = TriangleMesh(self.scene, mesh.vertices.astype("f4"), mesh.faces.astype("i4"))
        self.origins, self.directions = (np.ascontiguousarray(part) for part in (rays[:, :3], rays[:, 3:]))
        self.scene.run(self.origins[:1], self.directions[:1])

    def closest(self):
        hits = self.scene.run(self.origins, self.directions, output=1)
        return hits["primID"], hits["tfar"]

    def any(self):
        return self.scene.run(self.origins, self.directions, query="OCCLUDED") != -1

    count = None

    def one(self, ray):
        origins, directions = ray[None, :3].copy(), ray[None, 3:].copy()
        return lambda: self.scene.run(origins, directions, output=1)


def seconds(function):
    """Of the processor: on one core that is the time it takes, whatever else the machine is doing."""
    started = time.process_time()
    function()
    return time.process_time() - started


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--count", type=int, default=1_000_000, help="rays (default: a million)")
    parser.add_argument("--repeat", type=int, default=7, help="repetitions (default: 7)")
    args = parser.parse_args()

    print("| model | rays | query |", end="")
    header = False
    for model in args.models:
        mesh = trimesh.load(model, force="mesh", process=False)
        for kind, make in (("camera", camera), ("incoherent", incoherent)):
            rays = np.concatenate(make(mesh, args.count), axis=1).astype("f4")
            engines = [Firsthit("firsthit", mesh, rays), Firsthit("firsthit fast", mesh, rays, precision="fast")]
            engines += [Open3D(mesh, rays)] if open3d else []
            engines += [Embree(mesh, rays)] if rtcore_scene else []
            if not header:
                print("".join(f" {engine.name} |" for engine in engines))
                print("|---|---|---|" + "---|" * len(engines))
                header = True
            for query in ("closest", "any", "count"):
                times = [[] for _ in engines]
                for _ in range(args.repeat):
                    for engine, taken in zip(engines, times):
                        if getattr(engine, query):
                            taken.append(seconds(getattr(engine, query)))
                cells = [
                    f"{len(rays) / min(t) / 1e6:.2f} ({len(rays) / np.median(t) / 1e6:.2f})" if t else "-" for t in times
                ]
                name = f"{model.rsplit('/', 1)[-1]} ({len(mesh.faces)})"
                print(f"| {name} | {kind} {len(rays)} | {query} | {' | '.join(cells)} |", flush=True)
            found = [np.asarray(engine.closest()[1]) for engine in engines]
            hit = np.isfinite(found[0])
            print(f"|  | {kind} | hits | " + " | ".join(str(int((t < 1e30).sum())) for t in found) + " |")
            del engines
            assert hit.any()
        ray = rays[np.flatnonzero(hit)[0]].copy()
        engines = [Firsthit("firsthit", mesh, rays[:1]), Firsthit("firsthit fast", mesh, rays[:1], precision="fast")]
        engines += [Open3D(mesh, rays[:1])] if open3d else []
        engines += [Embree(mesh, rays[:1])] if rtcore_scene else []
        calls = [engine.one(ray) for engine in engines]
        best = [np.inf] * len(calls)
        for _ in range(20):
            for i, call in enumerate(calls):
                best[i] = min(best[i], seconds(lambda: [call() for _ in range(2000)]) / 2000)
        cells = " | ".join(f"{1e6 * t:.2f} us" for t in best)
        print(f"| {model.rsplit('/', 1)[-1]} | one ray a call | closest | {cells} |", flush=True)
    print("\nMillion rays a second of one core: the best (the median) of", args.repeat, "repetitions.")


if __name__ == "__main__":
    main()
