"""What is compiled of the package."""

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

INVALID_ID: int
"""The id of what there is not, 2**32 - 1: of a ray that meets nothing."""

_Precision = Literal["fast", "robust", "double", "exact"]
_Quality = Literal["fast", "balanced", "high"]
_Sign = Literal["auto", "winding", "fast_winding", "parity", "pseudonormal", "exact"]
_Crossings = Literal["triangles", "surfaces"]

@final
class Hits:
    """What each ray meets first. Fields are made when they are asked for, and have the shape of the rays.

    It also indexes like a dictionary: ``hits["t_hit"]``.
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading shape of the rays."""
    @property
    def hit(self) -> NDArray[np.bool_]:
        """Whether there is a hit."""
    @property
    def t_hit(self) -> NDArray[np.float64]:
        """Ray parameter, in lengths of the direction; infinity where there is no hit."""
    @property
    def instance_ids(self) -> NDArray[np.uint32]:
        """Index of the instance, or `INVALID_ID`."""
    @property
    def geometry_ids(self) -> NDArray[np.uint32]:
        """Index of the geometry in its mesh, or `INVALID_ID`."""
    @property
    def primitive_ids(self) -> NDArray[np.uint32]:
        """Index of the triangle in its geometry, or `INVALID_ID`."""
    @property
    def primitive_uvs(self) -> NDArray[np.float32]:
        """Weights of the triangle's second and third vertex, shape ``(..., 2)``."""
    @property
    def primitive_normals(self) -> NDArray[np.float64]:
        """Unit normals in the world by the winding of the triangle, shape ``(..., 3)``; zero where there is no hit."""
    def keys(self) -> list[str]: ...
    def __getitem__(self, key: str, /) -> NDArray[Any]: ...

@final
class HitLists:
    """Everything that each ray meets: one list of hits after the other, each sorted along its ray.

    The hits of ray ``i`` are those from ``ray_splits[i]`` to ``ray_splits[i + 1]``.
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading shape of the rays."""
    @property
    def ray_splits(self) -> NDArray[np.int64]:
        """Where the hits of each ray begin, and the end of the last: one more than there are rays."""
    @property
    def ray_ids(self) -> NDArray[np.int64]:
        """The ray of each hit, as an index into the flattened rays."""
    @property
    def t_hit(self) -> NDArray[np.float64]:
        """Ray parameter, in lengths of the direction."""
    @property
    def instance_ids(self) -> NDArray[np.uint32]:
        """Index of the instance."""
    @property
    def geometry_ids(self) -> NDArray[np.uint32]:
        """Index of the geometry in its mesh."""
    @property
    def primitive_ids(self) -> NDArray[np.uint32]:
        """Index of the triangle in its geometry."""
    @property
    def primitive_uvs(self) -> NDArray[np.float32]:
        """Weights of the triangle's second and third vertex, shape ``(n, 2)``."""
    @property
    def primitive_normals(self) -> NDArray[np.float64]:
        """Unit normals in the world by the winding of the triangle, shape ``(n, 3)``."""
    def keys(self) -> list[str]: ...
    def __getitem__(self, key: str, /) -> NDArray[Any]: ...
    def __len__(self) -> int: ...

@final
class ClosestPoints:
    """The nearest (or furthest) point of the surface for each point. It also indexes like a dictionary: ``nearest["points"]``."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading shape of the points."""
    @property
    def points(self) -> NDArray[np.float64]:
        """The points of the surface, shape ``(..., 3)``; NaN where there is none."""
    @property
    def distance(self) -> NDArray[np.float64]:
        """How far they are; infinity where there is none."""
    @property
    def instance_ids(self) -> NDArray[np.uint32]:
        """Index of the instance, or `INVALID_ID`."""
    @property
    def geometry_ids(self) -> NDArray[np.uint32]:
        """Index of the geometry in its mesh, or `INVALID_ID`."""
    @property
    def primitive_ids(self) -> NDArray[np.uint32]:
        """Index of the triangle in its geometry, or `INVALID_ID`."""
    @property
    def primitive_uvs(self) -> NDArray[np.float32]:
        """Weights of the triangle's second and third vertex, shape ``(..., 2)``."""
    @property
    def primitive_normals(self) -> NDArray[np.float64]:
        """Unit normals of the triangles by their winding, shape ``(..., 3)``."""
    def keys(self) -> list[str]: ...
    def __getitem__(self, key: str, /) -> NDArray[Any]: ...

class Scene:
    """Triangles and instances with their trees. Built once, then only asked, from any number of threads.

    Rays are given as an array of shape ``(..., 6)`` (origin and direction) or ``(..., 8)`` (``t_min`` and ``t_max``
    too), or as origins and directions of shape ``(..., 3)``, which are repeated to each other's shape as NumPy does.
    Anything that NumPy takes will do; arrays of 64- or 32-bit floats in order are not copied. The direction need not be
    unit. ``t_min`` and ``t_max`` are numbers or arrays, one for each ray. A ray with a NaN meets nothing.

    ``threads``: how many threads answer, 0 for one per core. Answers are the same bits for any number, and for one
    ray alone as among many. Other Python threads run meanwhile; arrays must not be changed by them.
    """

    def __init__(
        self,
        vertices: ArrayLike | Any,
        triangles: ArrayLike | None = None,
        *,
        transforms: ArrayLike | None = None,
        masks: ArrayLike | None = None,
        precision: _Precision = "robust",
        quality: _Quality = "balanced",
        threads: int = 0,
    ) -> None:
        """Builds a scene of vertices ``(n, 3)`` and triangles ``(m, 3)``, or of an object that has them: a mesh of
        trimesh or Open3D.

        Vertices are stored in 32 bits, as seen from the middle of the mesh where that loses less.

        ``transforms``: matrices ``(n, 4, 4)`` from the mesh to the world, one for each instance; as it stands, one instance
        where the vertices are. ``masks``: a number of 32 bits for each instance, see `seen_by`.

        Raises ValueError: for shapes that do not fit, vertices that are not finite, indices of no vertex.
        """
    def refit(self, vertices: ArrayLike, *, threads: int = 0) -> Scene:
        """This scene with its vertices moved, ``(n, 3)``: the tree gets new boxes, which is quicker than building, or is
        built anew where that would make it half as costly again. This scene stays as it is.

        Raises ValueError: as the constructor, for another number of vertices, and for scenes of files.
        """
    def with_transforms(
        self, transforms: ArrayLike, *, masks: ArrayLike | None = None, threads: int = 0
    ) -> Scene:
        """This scene with its instances elsewhere: matrices ``(n, 4, 4)``. Of more there are more instances, of fewer the last
        are gone. Masks stay unless there are new ones. The mesh and its tree are shared with this scene, which stays as it is.

        Raises ValueError: for matrices that are not affine or cannot be inverted, and for scenes of files.
        """
    def seen_by(self, mask: int) -> Scene:
        """This scene for queries that meet only the instances whose mask has one of these bits. The mesh and
        its tree are shared. Instances of files have all bits."""
    def closest_hit(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        mask: int | None = None,
        threads: int = 0,
    ) -> Hits:
        """What each ray meets first. Of several triangles at the same ``t``, that of the smallest id. With a ``mask``, as of
        `seen_by` (what that takes is kept for the next calls); so all queries."""
    def closest_hits(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        mask: int | None = None,
        threads: int = 0,
    ) -> Hits:
        """`closest_hit`."""
    def any_hit(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        mask: int | None = None,
        threads: int = 0,
    ) -> NDArray[np.bool_]:
        """Whether each ray meets anything."""
    def count_hits(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        crossings: _Crossings = "triangles",
        mask: int | None = None,
        threads: int = 0,
    ) -> NDArray[np.uint32]:
        """How often each ray meets something.

        With ``crossings="surfaces"`` a ray through an edge or a vertex crosses the surface there once, and the count
        of a closed mesh is odd from inside and even from outside.
        """
    def all_hits(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        crossings: _Crossings = "triangles",
        mask: int | None = None,
        threads: int = 0,
    ) -> HitLists:
        """Everything that each ray meets; for ``crossings`` see `count_hits`."""
    def closest_point(
        self, points: ArrayLike, *, radius: ArrayLike | None = None, mask: int | None = None, threads: int = 0
    ) -> ClosestPoints:
        """The nearest point of the surface (of files: of shapes too), for points of shape ``(..., 3)``; with a radius, one for all or one for
        each, only if it is not farther."""
    def furthest_point(
        self, points: ArrayLike, *, mask: int | None = None, threads: int = 0
    ) -> ClosestPoints:
        """The furthest point of the triangles, a vertex, for points of shape ``(..., 3)``."""
    def distance(self, points: ArrayLike, *, mask: int | None = None, threads: int = 0) -> NDArray[np.float64]:
        """How far the surface is; infinity if there is none, NaN for a point that is not finite."""
    def signed_distance(
        self, points: ArrayLike, *, sign: _Sign = "auto", mask: int | None = None, threads: int = 0
    ) -> NDArray[np.float64]:
        """`distance` of the triangles, negative inside.

        ``sign`` is how inside is told from outside: by the winding number (which holes do not upset; ``"fast_winding"``
        sums it over clusters of triangles), by the parity of the crossings of a ray (``"exact"`` decides them exactly),
        or by the normals at the nearest point. ``"auto"`` is winding, for closed meshes of mixed orientation parity.
        The first call takes a look at the whole mesh.
        """
    def contains(
        self, points: ArrayLike, *, sign: _Sign = "auto", mask: int | None = None, threads: int = 0
    ) -> NDArray[np.bool_]:
        """Whether points are inside; for ``sign`` see `signed_distance`. On the surface it is either."""
    def winding_number(
        self, points: ArrayLike, *, sign: _Sign = "auto", mask: int | None = None, threads: int = 0
    ) -> NDArray[np.float64]:
        """How often the surface winds around points: 1 inside of a closed mesh, 0 outside, a fraction where it is
        open. Only ``"fast_winding"`` is an approximation."""
    def is_watertight(self) -> bool:
        """Whether the surface has no holes: each edge has an even number of triangles."""
    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of a box around everything, shape ``(2, 3)``."""
    @property
    def precision(self) -> str:
        """The tier of precision it was built for."""
    @property
    def stats(self) -> dict[str, float]:
        """Triangles, instances, bytes, depth and surface-area cost of the trees."""
    @property
    def warnings(self) -> list[str]:
        """What of a file could be read only in part."""

def load(
    path: str | PathLike[str],
    *,
    precision: _Precision = "robust",
    quality: _Quality = "balanced",
    up: str | None = None,
    variant: str | None = None,
    threads: int = 0,
) -> Scene:
    """Reads a model or scene file: .gltf, .glb, .obj, .ply, .stl, .toml, .json; .obj, .ply and .stl also
    compressed (.obj.zst, .obj.gz).

    ``up``: the file's upward axis (``"+Z"``), which becomes +Y; by default what the format says. Such a scene is
    pickled as the path of its file.

    Raises OSError if the file cannot be read, ValueError if it is broken.
    """

def render(
    scene: Scene | str | PathLike[str],
    *,
    width: int = 1280,
    height: int = 720,
    samples: int = 16,
    noise_threshold: float | None = None,
    time_limit: float | None = None,
    seed: int = 0,
    integrator: str = "auto",
    camera: str | None = None,
    position: Sequence[float] | None = None,
    focal_point: Sequence[float] | None = None,
    view_up: Sequence[float] | None = None,
    view_angle: float | None = None,
    orthographic: bool = False,
    transparent: bool = False,
    exposure: float = 0.0,
    tone_mapping: Literal["pbr-neutral", "agx", "srgb", "none"] = "pbr-neutral",
    linear: bool = False,
    threads: int = 0,
) -> NDArray[Any]:
    """Renders a picture: ``(height, width, 4)`` of uint8, sRGB and alpha; with ``linear`` the radiance as float32,
    multiplied by alpha.

    ``samples`` per pixel (the most of them, with a ``noise_threshold`` or a ``time_limit`` in seconds); the angle is in
    degrees. The camera frames the scene unless it is told otherwise. Ctrl-C ends it.
    """
