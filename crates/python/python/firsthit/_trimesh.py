"""In the place of trimesh's own ray queries: ``mesh.ray = firsthit.trimesh_ray(mesh)``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._firsthit import INVALID_ID, Scene


class RayMeshIntersector:
    """Ray queries with the names, arguments and answers of trimesh.

    The tree is built on first use, and again when the mesh has changed. Each crossing of a surface is reported once,
    also where the ray passes through an edge. Hits of one ray are in the order in which it meets them.
    """

    def __init__(self, mesh: Any, precision: str = "robust") -> None:
        self.mesh = mesh
        self._precision = precision
        self._built: tuple[Any, Scene] | None = None

    @property
    def scene(self) -> Scene:
        """The mesh as it is now, to ask anything else."""
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            self._built = (state, Scene(self.mesh.vertices, self.mesh.faces, precision=self._precision))
        return self._built[1]

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Where rays meet the mesh: ``(locations, index_ray, index_tri)``."""
        triangles, rays, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True
        )
        return locations, rays, triangles

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> Any:
        """Which triangles rays meet: ``(index_tri, index_ray)``, and the locations if they are asked for."""
        origins, directions = _rays(ray_origins, ray_directions)
        if multiple_hits:
            hits = self.scene.all_hits(origins, directions, crossings="surfaces")
            rays, triangles, t = hits.ray_ids, hits.primitive_ids, hits.t_hit
            if max_hits is not None:
                kept = np.arange(len(rays)) - hits.ray_splits[rays] < max_hits
                rays, triangles, t = rays[kept], triangles[kept], t[kept]
        else:
            first = self.scene.closest_hit(origins, directions)
            rays = np.flatnonzero(first.hit)
            triangles, t = first.primitive_ids[rays], first.t_hit[rays]
        triangles = triangles.astype(np.int64)
        if return_locations:
            return triangles, rays, origins[rays] + t[:, None] * directions[rays]
        return triangles, rays

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int64]:
        """The first triangle that each ray meets, or -1."""
        ids = self.scene.closest_hit(*_rays(ray_origins, ray_directions)).primitive_ids
        return np.where(ids == INVALID_ID, -1, ids.astype(np.int64))

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray meets the mesh."""
        return self.scene.any_hit(*_rays(ray_origins, ray_directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point is inside: by the winding number, which holes do not upset."""
        return self.scene.contains(np.asarray(points, dtype=np.float64).reshape(-1, 3))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}


def trimesh_ray(mesh: Any, precision: str = "robust") -> RayMeshIntersector:
    """Ray queries of a ``trimesh.Trimesh`` by firsthit: ``mesh.ray = firsthit.trimesh_ray(mesh)``."""
    return RayMeshIntersector(mesh, precision)


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    origins = np.asarray(origins, dtype=np.float64)
    directions = np.asarray(directions, dtype=np.float64)
    if origins.shape != directions.shape:
        raise ValueError("Ray origin and direction don't match!")
    return origins.reshape(-1, 3), directions.reshape(-1, 3)
