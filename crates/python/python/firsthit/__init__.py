"""Ray queries on triangle meshes: closest, any and all hits, for one ray or millions.

>>> import firsthit
>>> scene = firsthit.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
>>> hits = scene.closest_hit([0.25, 0.25, 5], [0, 0, -1])
>>> float(hits.t_hit), int(hits.primitive_ids)
(5.0, 0)
>>> scene.any_hit([[0.25, 0.25, 5], [2, 2, 5]], [0, 0, -1])
array([ True, False])
"""

from ._camera import camera_rays
from ._firsthit import INVALID_ID, ClosestPoints, HitLists, Hits, Scene, __version__, load, render
from ._trimesh import RayMeshIntersector, trimesh_ray

__all__ = [
    "INVALID_ID",
    "ClosestPoints",
    "HitLists",
    "Hits",
    "RayMeshIntersector",
    "Scene",
    "__version__",
    "camera_rays",
    "load",
    "render",
    "trimesh_ray",
]
