"""The engines, each with what it can answer. An engine takes rays and points in the form that it likes best, made before the
clock starts: `rays(array)` and `points(array)`. What it does not have is None."""

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
try:
    import igl
except ImportError:
    igl = None
try:
    import warp

    warp.config.log_level = getattr(warp, "LOG_ERROR", 40)
    warp.config.quiet = True
except ImportError:
    warp = None


class Engine:
    closest = any = count = all = None
    closest_point = signed_distance = contains = None
    one_ray = one_any = one_point = None

    def rays(self, rays):
        return rays

    def points(self, points):
        return points


class Firsthit(Engine):
    name = "firsthit"
    options = {}

    def __init__(self, mesh):
        self.scene = firsthit.Scene(mesh.vertices.astype("f4"), mesh.faces, threads=1, **self.options)

    def closest(self, rays):
        hits = self.scene.closest_hit(rays, threads=1)
        return hits.primitive_ids, hits.t_hit

    def any(self, rays):
        return self.scene.any_hit(rays, threads=1)

    def count(self, rays):
        return self.scene.count_hits(rays, crossings="surfaces", threads=1)

    def all(self, rays):
        hits = self.scene.all_hits(rays, crossings="surfaces", threads=1)
        return hits.ray_splits, hits.primitive_ids, hits.t_hit

    def closest_point(self, points):
        nearest = self.scene.closest_point(points, threads=1)
        return nearest.points, nearest.primitive_ids

    def signed_distance(self, points):
        return self.scene.signed_distance(points, threads=1)

    def contains(self, points):
        return self.scene.contains(points, threads=1)

    def one_ray(self, ray):
        return lambda: self.scene.closest_hit(ray)

    def one_any(self, ray):
        return lambda: self.scene.any_hit(ray)

    def one_point(self, point):
        return lambda: self.scene.closest_point(point)


class Fast(Firsthit):
    name = "firsthit fast"
    options = {"precision": "fast"}


class Open3D(Engine):
    name = "Open3D"

    def __init__(self, mesh):
        self.scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self.scene.add_triangles(mesh.vertices.astype("f4"), mesh.faces.astype("u4"))
        # It builds the tree when it is first asked.
        self.scene.test_occlusions(open3d.core.Tensor(np.ones((1, 6), "f4")))

    def rays(self, rays):
        return open3d.core.Tensor(rays)

    points = rays

    def closest(self, rays):
        hits = self.scene.cast_rays(rays, nthreads=1)
        return hits["primitive_ids"].numpy(), hits["t_hit"].numpy()

    def any(self, rays):
        return self.scene.test_occlusions(rays, nthreads=1).numpy()

    def count(self, rays):
        return self.scene.count_intersections(rays, nthreads=1).numpy()

    def all(self, rays):
        hits = self.scene.list_intersections(rays, nthreads=1)
        return hits["ray_splits"].numpy(), hits["primitive_ids"].numpy(), hits["t_hit"].numpy()

    def closest_point(self, points):
        nearest = self.scene.compute_closest_points(points, nthreads=1)
        return nearest["points"].numpy(), nearest["primitive_ids"].numpy()

    def signed_distance(self, points):
        return self.scene.compute_signed_distance(points, nthreads=1).numpy()

    def contains(self, points):
        return self.scene.compute_occupancy(points, nthreads=1).numpy() > 0.5

    def one_ray(self, ray):
        ray = open3d.core.Tensor(ray[None])
        return lambda: self.scene.cast_rays(ray)

    def one_any(self, ray):
        ray = open3d.core.Tensor(ray[None])
        return lambda: self.scene.test_occlusions(ray)

    def one_point(self, point):
        point = open3d.core.Tensor(point[None])
        return lambda: self.scene.compute_closest_points(point)


class Embree(Engine):
    name = "embreex"

    def __init__(self, mesh):
        self.scene = rtcore_scene.EmbreeScene(robust=True)
        self.mesh = TriangleMesh(self.scene, mesh.vertices.astype("f4"), mesh.faces.astype("i4"))
        self.scene.run(np.ones((1, 3), "f4"), np.ones((1, 3), "f4"))

    def rays(self, rays):
        return np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])

    def closest(self, rays):
        hits = self.scene.run(*rays, output=1)
        return hits["primID"], np.where(hits["primID"] >= 0, hits["tfar"], np.inf)

    def any(self, rays):
        return self.scene.run(*rays, query="OCCLUDED") != -1

    def one_ray(self, ray):
        rays = self.rays(ray[None])
        return lambda: self.scene.run(*rays, output=1)

    def one_any(self, ray):
        rays = self.rays(ray[None])
        return lambda: self.scene.run(*rays, query="OCCLUDED")


class Trimesh(Engine):
    """With embreex for its rays."""

    name = "trimesh"

    def __init__(self, mesh):
        self.mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        self.mesh.ray.intersects_any(np.ones((1, 3)), np.ones((1, 3)))

    def rays(self, rays):
        return rays[:, :3].astype("f8"), rays[:, 3:].astype("f8")

    def any(self, rays):
        return self.mesh.ray.intersects_any(*rays)

    def all(self, rays):
        return self.mesh.ray.intersects_location(*rays)

    def closest_point(self, points):
        points, _, triangles = self.mesh.nearest.on_surface(points)
        return points, triangles

    def signed_distance(self, points):
        # It is positive inside.
        return -self.mesh.nearest.signed_distance(points)

    def contains(self, points):
        return self.mesh.contains(points)


class Libigl(Engine):
    name = "libigl"

    def __init__(self, mesh):
        self.vertices = np.ascontiguousarray(mesh.vertices, "f8")
        self.faces = np.ascontiguousarray(mesh.faces, "i8")
        self.tree = igl.AABB()
        self.tree.init(self.vertices, self.faces)

    def rays(self, rays):
        return np.ascontiguousarray(rays[:, :3], "f8"), np.ascontiguousarray(rays[:, 3:], "f8")

    def points(self, points):
        return points.astype("f8")

    def closest(self, rays):
        triangles, t, _ = self.tree.intersect_ray_first(self.vertices, self.faces, *rays)
        return triangles, np.where(triangles >= 0, t, np.inf)

    def all(self, rays):
        return self.tree.intersect_ray(self.vertices, self.faces, *rays)

    def closest_point(self, points):
        _, triangles, nearest = self.tree.squared_distance(self.vertices, self.faces, points)
        return nearest, triangles

    def signed_distance(self, points):
        return igl.signed_distance(points, self.vertices, self.faces)[0]

    def contains(self, points):
        return igl.fast_winding_number(self.vertices, self.faces, points) > 0.5

    def one_ray(self, ray):
        rays = self.rays(ray[None])
        return lambda: self.tree.intersect_ray_first(self.vertices, self.faces, *rays)

    def one_point(self, point):
        points = self.points(point[None])
        return lambda: self.tree.squared_distance(self.vertices, self.faces, points)


if warp:

    @warp.kernel
    def warp_closest(
        mesh: warp.uint64,
        origins: warp.array(dtype=warp.vec3),
        directions: warp.array(dtype=warp.vec3),
        ids: warp.array(dtype=warp.int32),
        ts: warp.array(dtype=warp.float32),
    ):
        i = warp.tid()
        hit = warp.mesh_query_ray(mesh, origins[i], directions[i], 1.0e30)
        ids[i] = -1
        ts[i] = warp.inf
        if hit.result:
            ids[i] = hit.face
            ts[i] = hit.t

    @warp.kernel
    def warp_any(
        mesh: warp.uint64,
        origins: warp.array(dtype=warp.vec3),
        directions: warp.array(dtype=warp.vec3),
        hits: warp.array(dtype=warp.bool),
    ):
        i = warp.tid()
        hits[i] = warp.mesh_query_ray_anyhit(mesh, origins[i], directions[i], 1.0e30)

    @warp.kernel
    def warp_count(
        mesh: warp.uint64,
        origins: warp.array(dtype=warp.vec3),
        directions: warp.array(dtype=warp.vec3),
        counts: warp.array(dtype=warp.int32),
    ):
        i = warp.tid()
        counts[i] = warp.mesh_query_ray_count_intersections(mesh, origins[i], directions[i])

    @warp.kernel
    def warp_nearest(
        mesh: warp.uint64,
        points: warp.array(dtype=warp.vec3),
        nearest: warp.array(dtype=warp.vec3),
        ids: warp.array(dtype=warp.int32),
    ):
        i = warp.tid()
        found = warp.mesh_query_point_no_sign(mesh, points[i], 1.0e30)
        ids[i] = found.face
        nearest[i] = warp.mesh_eval_position(mesh, found.face, found.u, found.v)

    @warp.kernel
    def warp_signed(mesh: warp.uint64, points: warp.array(dtype=warp.vec3), distances: warp.array(dtype=warp.float32)):
        i = warp.tid()
        found = warp.mesh_query_point_sign_normal(mesh, points[i], 1.0e30)
        at = warp.mesh_eval_position(mesh, found.face, found.u, found.v)
        distances[i] = found.sign * warp.length(points[i] - at)

    @warp.kernel
    def warp_inside(mesh: warp.uint64, points: warp.array(dtype=warp.vec3), inside: warp.array(dtype=warp.bool)):
        i = warp.tid()
        found = warp.mesh_query_point_sign_winding_number(mesh, points[i], 1.0e30)
        inside[i] = found.sign < 0.0


class Warp(Engine):
    """On its device for processors."""

    name = "warp"
    winding = True

    def __init__(self, mesh):
        self.mesh = warp.Mesh(
            points=warp.array(mesh.vertices.astype("f4"), dtype=warp.vec3, device="cpu"),
            indices=warp.array(mesh.faces.astype("i4").ravel(), dtype=warp.int32, device="cpu"),
            support_winding_number=self.winding,
        )

    def rays(self, rays):
        return self.points(rays[:, :3]), self.points(rays[:, 3:])

    def points(self, points):
        return warp.array(np.ascontiguousarray(points), dtype=warp.vec3, device="cpu")

    def launch(self, kernel, inputs, outputs):
        count = len(inputs[0])
        outputs = [warp.empty(count, dtype=kind, device="cpu") for kind in outputs]
        warp.launch(kernel, dim=count, inputs=[self.mesh.id, *inputs], outputs=outputs, device="cpu")
        return [output.numpy() for output in outputs]

    def closest(self, rays):
        return self.launch(warp_closest, rays, [warp.int32, warp.float32])

    def any(self, rays):
        return self.launch(warp_any, rays, [warp.bool])[0]

    def count(self, rays):
        return self.launch(warp_count, rays, [warp.int32])[0]

    def closest_point(self, points):
        return self.launch(warp_nearest, [points], [warp.vec3, warp.int32])

    def signed_distance(self, points):
        return self.launch(warp_signed, [points], [warp.float32])[0]

    def contains(self, points):
        return self.launch(warp_inside, [points], [warp.bool])[0]

    def one_ray(self, ray):
        rays = self.rays(ray[None])
        return lambda: self.closest(rays)

    def one_any(self, ray):
        rays = self.rays(ray[None])
        return lambda: self.any(rays)

    def one_point(self, point):
        points = self.points(point[None])
        return lambda: self.closest_point(points)


class PlainWarp(Warp):
    """As it is made unless winding numbers are wanted."""

    winding = False


ENGINES = [Firsthit, Fast]
ENGINES += [Open3D] if open3d else []
ENGINES += [Embree, Trimesh] if rtcore_scene else []
ENGINES += [Libigl] if igl else []
ENGINES += [Warp] if warp else []
