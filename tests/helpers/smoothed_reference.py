"""Edge-smoothed elements evaluated one by one in plain numpy, apart from pdvol's own."""

from collections import defaultdict
from itertools import combinations

import numpy as np


def cell_gradient(mesh, cell, positions):
    """F (d, d) of one cell, from its edges."""
    corners = mesh.cells[cell]
    at_rest, now = (p[corners[1:]] - p[corners[0]] for p in (mesh.points, positions))
    return np.linalg.solve(at_rest, now).T


def cell_volume(mesh, cell):
    corners = mesh.points[mesh.cells[cell]]
    return abs(np.linalg.det(corners[1:] - corners[0])) / (2.0 if mesh.dim == 2 else 6.0)


def edge_domains(mesh, materials, positions, among=None):
    """Of each edge within each material: its cells, F (d, d) and volume. `materials` (m,) are any marks of cells;
    `among` are the cells that count, all where not given.
    """
    around = defaultdict(list)
    for cell in range(len(mesh.cells)) if among is None else among:
        for edge in combinations(sorted(mesh.cells[cell]), 2):
            around[edge, materials[cell]].append(cell)
    for cells in around.values():
        volumes = [cell_volume(mesh, cell) for cell in cells]
        F = sum(v * cell_gradient(mesh, cell, positions) for v, cell in zip(volumes, cells, strict=True)) / sum(volumes)
        yield cells, F, sum(volumes) / (3.0 if mesh.dim == 2 else 6.0)


def mean(mesh, cells, values):
    """The volume-weighted mean of cells' values."""
    volumes = [cell_volume(mesh, cell) for cell in cells]
    return np.dot(volumes, values[cells]) / sum(volumes)


def neo_hookean(F, mu, lmbda):
    ln_J = np.log(np.linalg.det(F))
    return mu / 2 * (np.sum(F * F) - len(F)) - mu * ln_J + lmbda / 2 * ln_J**2


def st_venant_kirchhoff(F, mu, lmbda):
    E = (F.T @ F - np.eye(len(F))) / 2
    return mu * np.sum(E * E) + lmbda / 2 * np.trace(E) ** 2
