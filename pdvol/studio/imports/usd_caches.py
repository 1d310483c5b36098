"""USD files: meshes, also of instances, the places of what they hang on, and skeletons."""

from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.meshing.losses import counted

DRAWN_PURPOSES = ("default", "render")
NOT_READ = ("Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane", "NurbsPatch", "BasisCurves", "Points", "TetMesh")
"""Kinds of shapes that are no meshes."""

Within = tuple[tuple[Any, int, Any], ...]
"""Point instancers around a mesh, the inner ones first: paths of the instancer and of the instance's prototype, and
between them the instance's number.
"""


class UsdFile:
    """An open USD file, a `SceneFile`. Times are time codes. An instance of a point instancer is named by its number,
    as `/trees[3]/leaf`.
    """

    unit = "time code {:g}"

    def __init__(self, path: Path):
        from pxr import Usd, UsdGeom, Work

        Work.SetConcurrencyLimit(1)  # threads take address space, which is limited
        self._path, self._stage, self._geometry = path, Usd.Stage.Open(str(path)), UsdGeom
        self._earliest = Usd.TimeCode.EarliestTime()
        self._metres, self.rate = UsdGeom.GetStageMetersPerUnit(self._stage), self._stage.GetTimeCodesPerSecond()
        self._baked, self._others = set[Any](), list[str]()
        self._found = {name: found for name, *found in self._below(self._stage.GetPseudoRoot().GetPath())}
        self.names = list(self._found)
        errors = [" ".join(str(error).split())[:160] for error in self._stage.GetCompositionErrors()]
        self.lost = [
            *counted("references that cannot be read", errors),
            *counted("shapes left out, which are no meshes", self._others),
        ]
        self._transforms = cache(UsdGeom.XformCache)
        self._places: dict[tuple[Any, Any], np.ndarray] = {}

    def _below(self, root: Any, start: str = "", within: Within = ()) -> Iterator[tuple[str, Any, Within]]:
        """Names and paths of meshes at and below a path, and the point instancers around them."""
        from pxr import Usd

        kept = Usd.PrimIsActive & Usd.PrimIsLoaded if within else Usd.PrimDefaultPredicate  # prototypes may be classes
        walk = iter(Usd.PrimRange(self._stage.GetPrimAtPath(root), Usd.TraverseInstanceProxies(kept)))
        for prim in walk:
            name = start + str(prim.GetPath()).removeprefix(str(root) if within else "")
            if prim.IsA(self._geometry.PointInstancer):
                walk.PruneChildren()
                yield from self._instanced(self._geometry.PointInstancer(prim), name, within)
            elif prim.IsA(self._geometry.Mesh):
                yield name, prim.GetPath(), within
            elif prim.GetTypeName() in NOT_READ:
                self._others.append(f"{prim.GetTypeName()} {name}")

    def _instanced(self, instancer: Any, name: str, within: Within) -> Iterator[tuple[str, Any, Within]]:
        kinds = instancer.GetProtoIndicesAttr().Get(self._earliest) or ()
        roots = instancer.GetPrototypesRel().GetForwardedTargets()
        seen = instancer.ComputeMaskAtTime(self._earliest) or [True] * len(kinds)
        if any(not 0 <= kind < len(roots) or not self._stage.GetPrimAtPath(roots[kind]) for kind in set(kinds)):
            raise InputError(f"{self._path}: {name} has instances of prototypes that there are not; export it again")
        for number in (number for number, one in enumerate(seen) if one):
            root = roots[kinds[number]]
            if any(root == other for _, _, other in within):
                raise InputError(f"{self._path}: {name} is an instance of itself; export it again")
            yield from self._below(root, f"{name}[{number}]", ((instancer.GetPath(), number, root), *within))

    def _prim(self, path: Any) -> Any:
        return self._stage.GetPrimAtPath(path)

    def _mesh(self, name: str) -> Any:
        return self._geometry.Mesh(self._prim(self._found[name][0]))

    def _instances(self, path: Any, code: Any) -> np.ndarray:
        """(i, 4, 4): the matrices of a point instancer's instances, which multiply rows from the right."""
        if (path, code) not in self._places:
            kind = self._geometry.PointInstancer
            rules = kind.IncludeProtoXform, kind.IgnoreMask
            found = kind(self._prim(path)).ComputeInstanceTransformsAtTime(code, code, *rules)
            self._places[path, code] = np.array(found).reshape(-1, 4, 4)
        return self._places[path, code]

    def _code(self, time: float | None) -> Any:
        return self._earliest if time is None else type(self._earliest)(time)

    def _matrix(self, name: str, time: float | None) -> np.ndarray:
        code, (path, within) = self._code(time), self._found[name]
        transforms, matrix = self._transforms(code), np.eye(4)
        for instancer, number, root in within:
            places = self._instances(instancer, code)
            if number >= len(places):
                raise InputError(f"{self._path}: {name} has no place at {self.unit.format(time or 0)}; export it again")
            own, _ = transforms.ComputeRelativeTransform(self._prim(path), self._prim(root))
            matrix, path = matrix @ np.array(own) @ places[number], instancer
        return matrix @ np.array(transforms.GetLocalToWorldTransform(self._prim(path)))

    def drawn(self, name: str) -> bool:
        """Instances are shown where their instancer is."""
        path, within = self._found[name]
        image = self._geometry.Imageable(self._prim(within[-1][0] if within else path))
        visible = image.ComputeVisibility(self._earliest) != self._geometry.Tokens.invisible
        return visible and image.ComputePurpose() in DRAWN_PURPOSES

    def times(self, name: str) -> Iterable[float]:
        """Time codes; a skeleton or blend shapes that move the mesh are evaluated at its own."""
        self._bake_skeleton(name)
        codes, (path, within) = set(self._mesh(name).GetPointsAttr().GetTimeSamples()), self._found[name]
        for instancer, _, root in within:
            codes |= _place_codes(self._prim(path), root)
            codes = codes.union(*(found.GetTimeSamples() for found in self._prim(instancer).GetAttributes()))
            path = instancer
        return codes | _place_codes(self._prim(path), None)

    def points(self, name: str, time: float | None) -> np.ndarray:
        """In metres."""
        points = self._mesh(name).GetPointsAttr().Get(self._code(time))
        local = np.asarray(() if points is None else points, dtype=np.float64).reshape(-1, 3)
        matrix = self._matrix(name, time)
        return self._metres * (local @ matrix[:3, :3] + matrix[3, :3])

    def faces(self, name: str) -> tuple[np.ndarray, np.ndarray, bool]:
        """Of a mirrored mesh the corners go the other way round."""
        mesh = self._mesh(name)
        counts, corners = (
            np.asarray(attribute.Get(self._earliest) or (), dtype=np.int64)
            for attribute in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
        )
        left = mesh.GetOrientationAttr().Get() == self._geometry.Tokens.leftHanded
        return counts, corners, left != bool(np.linalg.det(self._matrix(name, None)[:3, :3]) < 0.0)

    def groups(self, name: str) -> Iterable[str]:
        """Subsets of faces, as materials are given to."""
        subsets = self._geometry.Subset.GetAllGeomSubsets(self._geometry.Imageable(self._mesh(name)))
        return [subset.GetPrim().GetName() for subset in subsets]

    def _bake_skeleton(self, name: str) -> None:
        """Where a skeleton or blend shapes move a mesh, give its points samples, in memory: the file stays as it is."""
        from pxr import Gf, Tf, UsdSkel

        path, own = self._found[name][0], self._stage.GetSessionLayer()
        if not UsdSkel.Root.Find(self._prim(path)):
            return
        while (above := self._prim(path)).IsInstanceProxy():  # no samples can be given to what instances share
            while above.IsInstanceProxy():
                above = above.GetParent()
            self._stage.SetEditTarget(own)
            above.SetInstanceable(False)
        root, points, reason = UsdSkel.Root.Find(self._prim(path)), path.AppendProperty("points"), ""
        if root.GetPath() not in self._baked:  # once for all of its meshes
            self._baked.add(root.GetPath())
            own.timeCodesPerSecond = self.rate  # else its samples are stretched to the file's rate
            self._stage.SetEditTarget(own)
            try:
                UsdSkel.BakeSkinning(root, Gf.Interval.GetFullInterval())
            except Tf.ErrorException as error:
                reason = f" ({str(error).strip().splitlines()[-1].strip()[:120]})"
        given = own.GetAttributeAtPath(points)  # without a value where the mesh's weights do not fit its points
        if reason or (given and not given.HasDefaultValue() and not own.ListTimeSamplesForPath(points)):
            raise InputError(
                f"{self._path}: the mesh {name}: its skeleton cannot be evaluated{reason}; export it with baked points"
            )


def _place_codes(prim: Any, root: Any) -> set[float]:
    """The time codes at which the place of a prim, or of one above it, is given, up to the path `root`."""
    from pxr import UsdGeom

    codes: set[float] = set()
    while prim:
        placed = UsdGeom.Xformable(prim)
        codes |= set(placed.GetTimeSamples() if placed else ())
        if prim.GetPath() == root or (placed and placed.GetResetXformStack()):
            break
        prim = prim.GetParent()
    return codes
