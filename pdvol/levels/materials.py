"""The materials of cells, and the cells of muscles: chosen on the coarsest level, carried to finer ones by the binding
(docs/scenes.md).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import ufl

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh, simplex_centres
from pdvol.scene import Keyed, Material, Muscle, Region, Scene, lame
from pdvol.scene.checks import called, chosen

if TYPE_CHECKING:  # it loads the finite elements, which describing a scene does not need
    from pdvol.levels.hierarchy import Hierarchy


@dataclass(frozen=True, eq=False)
class CellMaterials:
    """The materials of a level's m cells, in the input's order, replicated.

    Attributes
    ----------
    laws : the classes that occur
    law : (m,) int32, index into `laws`
    values : for each law, its psi's parameters by name: arrays (m,), of vectors (m, d), zero where another law holds
    young, density, damping : (m,) [Pa], [kg/m^d], [s]
    softest : the lowest Young's modulus [Pa] on the coarsest level, at any time
    smoothing : (m,) int32
        Number of the material of each cell whose body has smoothed elements, -1 of other cells. Two cells with the same
        number are of one body and of one of its materials.
    keyed : what Young's modulus follows in time, and the cells (m,) bool that do; the other fields are those at t = 0
    """

    laws: tuple[type[Material], ...]
    law: np.ndarray
    values: tuple[dict[str, np.ndarray], ...]
    young: np.ndarray
    density: np.ndarray
    damping: np.ndarray
    softest: float
    smoothing: np.ndarray
    keyed: tuple[tuple[Keyed, np.ndarray], ...] = ()

    def young_shares(self, time: float) -> np.ndarray:
        """(m,) Young's modulus at a time [s] over that at t = 0."""
        shares = np.ones(len(self.law))
        for follows, cells in self.keyed:
            shares[cells] = follows(time) / follows(0.0)
        return shares

    def carried(self, origins: np.ndarray) -> "CellMaterials":
        """The same on a finer level whose cells inherit from these: `origins` (m_fine,)."""
        arrays = {name: getattr(self, name)[origins] for name in ("law", "young", "density", "damping", "smoothing")}
        values = tuple({name: v[origins] for name, v in of_law.items()} for of_law in self.values)
        keyed = tuple((follows, cells[origins]) for follows, cells in self.keyed)
        return replace(self, values=values, keyed=keyed, **arrays)


def cell_materials(scene: Scene, mesh: LevelMesh) -> CellMaterials:
    """Materials of the cells of a scene's coarsest level, by body, region and position.

    Raises
    ------
    InputError
        A region holds no cell, or a function fails or gives what is out of range.
    """
    centres = simplex_centres(mesh.points, mesh.cells)
    parts: list[tuple[Material, np.ndarray]] = []
    smoothed: list[bool] = []
    for i, body in enumerate(scene.bodies):
        choice = np.where(mesh.bodies == i, 0, -1)
        for number, region in enumerate(body.regions, 1):
            choice[_held(region, f"body {body.name!r}, region {number}", mesh, mesh.bodies == i)] = number
        parts += [
            (m, np.flatnonzero(choice == number))
            for number, m in enumerate((body.material, *(r.material for r in body.regions)))
        ]
        smoothed += [scene.elements_of(body) == "smoothed"] * (1 + len(body.regions))
    laws = tuple(dict.fromkeys(type(material) for material, _ in parts))
    law = np.zeros(len(mesh.cells), dtype=np.int32)
    fields = {name: np.zeros(len(mesh.cells)) for name in ("young", "density", "damping")}
    values = tuple(dict[str, np.ndarray]() for _ in laws)
    keyed: list[tuple[Keyed, np.ndarray]] = []
    smoothing = np.full(len(mesh.cells), -1, dtype=np.int32)
    for part, (material, cells) in enumerate(parts):
        found, number = material.at(centres[cells]), laws.index(type(material))
        found["mu"], found["lmbda"] = lame(found["young"], found["poisson"])
        law[cells], smoothing[cells] = number, part if smoothed[part] else -1
        keyed += [(follows, np.isin(np.arange(len(mesh.cells)), cells)) for follows in material.keyed if len(cells)]
        for name, into in fields.items():
            into[cells] = found[name]
        for name in ("mu", "lmbda", *material.own_parameters()):
            shape = len(mesh.cells), *found[name].shape[1:]
            if (into := values[number].setdefault(name, np.zeros(shape))).shape != shape:
                raise InputError(f"{laws[number].__name__}.{name} is a vector in one place, and a number in another")
            into[cells] = found[name]
    softest = min([float(fields["young"].min()), *(min(follows.values) for follows, _ in keyed)])
    return CellMaterials(laws, law, values, **fields, softest=softest, smoothing=smoothing, keyed=tuple(keyed))


def _held(region: Region, name: str, mesh: LevelMesh, mine: np.ndarray) -> np.ndarray:
    if callable(region.where):
        places, held = simplex_centres(mesh.on_the_shape, mesh.cells)[mine], mine.copy()
        held[mine] = called(f"{name}: `where`", region.where, (places,), (len(places),)).astype(bool)
        mend = "widen its `where`, or give the coarsest level more vertices"
    else:
        held = mine & np.isin(mesh.regions, region.labels)
        mend = f"the labels there are {sorted(set(mesh.regions[mine].tolist()))}"
    if not held.any():
        raise InputError(f"{name} holds no cell of the coarsest level; {mend}")
    return held


def level_materials(scene: Scene, hierarchy: "Hierarchy", level: int) -> CellMaterials:
    """Materials of the cells of any level. Collective where they differ within a body: only then is anything bound."""
    if level == 0 or all(body.uniform for body in scene.bodies):
        return cell_materials(scene, hierarchy.meshes[level])
    return cell_materials(scene, hierarchy.meshes[0]).carried(hierarchy.origins(level))


@dataclass(frozen=True, eq=False)
class CellMuscle:
    """A muscle on a level.

    Attributes
    ----------
    cells : (k,) int64, ascending, in the input's order
    places : (k, d) [m]
        Where its functions are evaluated: centres of the coarsest level's cells.
    fibres : (k, d) unit vectors
    """

    muscle: Muscle
    cells: np.ndarray
    places: np.ndarray
    fibres: np.ndarray

    def carried(self, origins: np.ndarray) -> "CellMuscle":
        """The same on a finer level whose cells inherit from these: `origins` (m_fine,)."""
        rows = np.full(int(origins.max(initial=0)) + 1, -1)
        known = self.cells < len(rows)
        rows[self.cells[known]] = np.flatnonzero(known)
        taken = rows[origins]
        cells = np.flatnonzero(taken >= 0)
        return CellMuscle(self.muscle, cells, self.places[taken[cells]], self.fibres[taken[cells]])


def cell_muscles(scene: Scene, mesh: LevelMesh) -> tuple[CellMuscle, ...]:
    """The muscles on a scene's coarsest level.

    Raises
    ------
    InputError
        A muscle holds no cell, or one of its functions fails at the start or at the end of the scene.
    """
    if not scene.muscles:
        return ()
    names, centres = [body.name for body in scene.bodies], simplex_centres(mesh.points, mesh.cells)
    places = simplex_centres(mesh.on_the_shape, mesh.cells)
    found = []
    for muscle in scene.muscles:
        mine = mesh.bodies == names.index(muscle.body)
        mine[mine] = chosen("Muscle.where", muscle.where, places[mine])
        cells = np.flatnonzero(mine)
        if len(cells) == 0:
            raise InputError(
                f"Muscle.where holds no cell of body {muscle.body!r} on the coarsest level; widen it, or give that"
                " level more vertices"
            )
        for time in (0.0, scene.dt, scene.dt * scene.steps):
            muscle.tension(time, centres[cells])
        found.append(CellMuscle(muscle, cells, centres[cells], muscle.fibres(centres[cells])))
    return tuple(found)


def level_muscles(scene: Scene, hierarchy: "Hierarchy", level: int) -> tuple[CellMuscle, ...]:
    """The muscles on any level. Collective where there are some: only then is anything bound."""
    coarsest = cell_muscles(scene, hierarchy.meshes[0])
    if level == 0 or not coarsest:
        return coarsest
    origins = hierarchy.origins(level)
    return tuple(muscle.carried(origins) for muscle in coarsest)


def check_laws(scene: Scene, dim: int, materials: CellMaterials) -> None:
    """Raise InputError unless every law's psi takes its parameters and gives one number."""
    ones = ufl.as_vector([1.0] * dim)
    F = ufl.as_matrix(np.eye(dim) + np.diag(np.full(dim - 1, 0.1), 1) + 0.1 * np.eye(dim))
    for body in scene.bodies:
        for material in (body.material, *(region.material for region in body.regions)):
            law = type(material)
            values = materials.values[materials.laws.index(law)]
            try:
                psi = ufl.as_ufl(law.psi(F, **{k: 1.0 if v.ndim == 1 else ones for k, v in values.items()}))
            except InputError:
                raise
            except Exception as error:
                raise InputError(
                    f"body {body.name!r}: {law.__name__}.psi(F, {', '.join(values)}) failed: {type(error).__name__}: "
                    f"{' '.join(str(error).split())}"
                ) from error
            if psi.ufl_shape != ():
                raise InputError(
                    f"body {body.name!r}: {law.__name__}.psi must give one number, the energy density, not shape"
                    f" {psi.ufl_shape}"
                )
