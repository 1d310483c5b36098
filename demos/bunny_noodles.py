"""Nine bunny-shaped slices, soft and thin as noodles, fall into a small bowl (paper, figure "bunny noodles"): they hang
over its rim and fold over each other, on level 0, too.

Does the pile have the same order from below to above on all levels, and does level 0 bend as the others do?
"""

import numpy as np
from scipy.spatial import cKDTree

import pdvol
import recipes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

HEIGHT, THICKNESS = 0.40, 0.01  # m, of a slice
LAYERS = 2  # cells through the thickness: with one, level 0 would be 1.6 times as stiff in bending
RADIUS, DEPTH = 0.17, 0.12  # m, inside the bowl: slices are wider than it
SPACING = 0.05  # m, from slice to slice at the start
ASIDE = 0.07  # m, from the bowl's axis, at most
REACH = 0.02  # m: a fold is what bends a slice over this length, which is less than a cell of level 0 is wide
SAMPLES = 2_000  # points a slice, at which its upper face is looked at
ALIKE = 0.6  # of the finest level's bend, that level 0 has


def scene(slices=9, vertices=(60, 140, 320), young=5e3, mu=0.2, damping=0.04, seed=1, steps=120, dt=0.01):
    """The `slices`, stacked in the air and turned at random by `seed`, fall one after the other.

    A face of a slice has `vertices`. Under its own weight a strip bends over (E t^2 / 12 rho g)^(1/3) = 16 mm, which is
    little beside its 40 cm.
    """
    random = np.random.default_rng(seed)
    noodle = Body(
        tuple(recipes.bunny_slice(HEIGHT, THICKNESS, count, LAYERS) for count in vertices),
        NeoHookean(young, 0.35, 1000.0, damping=damping),
        name="slice",
    )
    places = []
    for k in range(slices):
        x, z = random.uniform(-ASIDE, ASIDE, 2)
        places.append(Placement((x, DEPTH + 0.06 + SPACING * k, z), random.uniform(0.0, 2.0 * np.pi), (0.0, 1.0, 0.0)))
    return Scene(
        bodies=noodle.instances(*places),
        obstacles=(
            Plane((0.0, -0.03, 0.0), (0.0, 1.0, 0.0), name="table"),
            Rigid(meshes.bowl(RADIUS, DEPTH, 0.02), name="bowl", opacity=0.35),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def heights(run, level):
    """Of the middles of the slices at the end [m]."""
    bodies, last = run.levels[level].mesh.point_bodies, run.levels[level].positions(run.levels[level].steps - 1)
    return np.bincount(bodies, last[:, 1]) / np.bincount(bodies)


def upper_faces(run, level):
    """Of each slice at the end: `SAMPLES` points (n, 3) [m] of its upper face at rest, and the normals (n, 3) of its
    facets there, at rest and at the end.
    """
    stored, random = run.levels[level], np.random.default_rng(0)
    corners = [x[stored.surface] for x in (stored.rest, stored.positions(stored.steps - 1))]
    at_rest, now = (np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners)
    areas = np.linalg.norm(at_rest, axis=1)
    upper, bodies = at_rest[:, 1] > 0.9 * areas, stored.mesh.point_bodies[stored.surface[:, 0]]
    for body in range(bodies.max() + 1):
        faces = np.flatnonzero(upper & (bodies == body))
        chosen = random.choice(faces, SAMPLES, p=areas[faces] / areas[faces].sum())
        points = np.einsum("nc,ncd->nd", random.dirichlet((1.0, 1.0, 1.0), SAMPLES), corners[0][chosen])
        yield points, at_rest[chosen], now[chosen]


def turns(run, level):
    """How much angles [degrees] between places of a slice's upper face, `REACH` apart, have changed by the end."""
    found = []
    for points, at_rest, now in upper_faces(run, level):
        pairs = cKDTree(points).query_pairs(1.1 * REACH, output_type="ndarray")
        one, other = pairs[np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) > 0.9 * REACH].T
        found.append(np.abs(angles(now[one], now[other]) - angles(at_rest[one], at_rest[other])))
    return np.concatenate(found)


def folded(run, level):
    """The part of all pairs of places of a slice's upper face that look more than 90 degrees apart at the end, for each
    slice.
    """
    half = SAMPLES // 2
    return np.array([np.mean(angles(now[:half], now[half:]) > 90.0) for _, _, now in upper_faces(run, level)])


def angles(one, other):
    """Between rows (n, 3) of both [degrees]."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("nd,nd->n", one, other)))


def claim(run):
    """The pile keeps its order on all levels, and slices are folded and bent on level 0 as on the others. A slice is
    above another where it is higher by more than a thickness.
    """
    first = heights(run, 0)
    apart = np.subtract.outer(first, first)
    above = apart > THICKNESS
    kept = [np.subtract.outer(x, x) > 0.0 for x in (heights(run, level) for level in range(1, len(run.levels)))]
    among, of_all = ([float(each[pairs].mean()) for each in kept] for pairs in (above, apart > 0.0))
    same, all_same = (", ".join(f"{100 * share:.1f}" for share in shares) for shares in (among, of_all))
    found = [
        (
            f"Of {above.sum()} pairs of slices whose heights on level 0 differ by more than a thickness, {same} %"
            f" have the same order on finer levels; of all pairs {all_same} %.",
            min(among) > 0.95,
        )
    ]
    folds = [folded(run, level).mean() for level in range(len(run.levels))]
    found.append(
        (
            f"Of all pairs of places on a slice, {', '.join(f'{100 * fold:.0f}' for fold in folds)} % look more than a"
            " right angle from each other on the levels: slices are folded.",
            min(folds) > ALIKE * max(folds) > 0.0,
        )
    )
    bends = [turns(run, level).mean() for level in range(len(run.levels))]
    found.append(
        (
            f"Over {100 * REACH:.0f} cm, slices are bent by {', '.join(f'{bend:.1f}' for bend in bends)} degrees on the"
            f" levels in the mean: level 0 has {100 * bends[0] / bends[-1]:.0f} % of the finest level's bend.",
            bends[0] > ALIKE * bends[-1],
        )
    )
    return found


if __name__ == "__main__":
    pdvol.main(scene)
