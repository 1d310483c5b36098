"""A stored state as a dolfinx function: what UFL computes of it on one rank and two, against the log and NumPy."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import small
import ufl
from dolfinx import fem, io
from mpi4py import MPI

import pdvol
from on_ranks import results_on
from pdvol import Body, NeoHookean, Placement
from pdvol.forms.elasticity import neo_hookean
from pdvol.scene.materials import lame
from shapes import solid

STEP = 4
YOUNG, POISSON = (1e4, 5e4), 0.4  # of two bodies [Pa]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A soft square and a stiff one above it, of linear elements, which fall on the ground."""
    bodies = tuple(
        Body(
            (solid(2, 2), solid(2, 4)),
            NeoHookean(young, POISSON),
            name=f"square {i}",
            placement=Placement(np.array([0.0, 0.005 + 1.01 * i])),
        )
        for i, young in enumerate(YOUNG)
    )
    return pdvol.run(
        replace(small.scene(steps=STEP), bodies=bodies, elements="linear"), tmp_path_factory.mktemp("run") / "squares"
    )


def computed(comm, path, xdmf):
    """Cauchy stresses in input order, energy [J/m] and the integral of the velocity; writes displacement and stress."""
    level = pdvol.open_run(path).levels[1]
    u, space = level.displacement(STEP, comm), level.space(comm)
    mu, lmbda = lame(space.cell_function(np.array(YOUNG)[level.bodies], "young"), POISSON)
    F = ufl.variable(ufl.Identity(2) + ufl.grad(u))
    psi = neo_hookean(F, mu, lmbda)
    tensors = fem.functionspace(space.domain, ("DG", 0, (2, 2)))
    mean = ufl.inner(ufl.diff(psi, F) * F.T / ufl.det(F), ufl.TestFunction(tensors)) / ufl.CellVolume(space.domain)
    stress = fem.Function(tensors, name="stress")
    stress.x.array[:] = fem.assemble_vector(fem.form(mean * ufl.dx)).array
    with io.XDMFFile(comm, xdmf, "w") as file:
        file.write_mesh(space.domain)
        file.write_function(u)
        file.write_function(stress)
    velocity = space.function(level.velocities(STEP), "velocity")
    owned = space.domain.topology.index_map(2).size_local
    pieces = comm.allgather((space.domain_cells[:owned], stress.x.array.reshape(-1, 2, 2)[:owned]))
    cells, stresses = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    total = lambda density: comm.allreduce(fem.assemble_scalar(fem.form(density * ufl.dx)))
    return {"stresses": stresses[np.argsort(cells)], "energy": total(psi), "momentum": total(velocity[1])}


@pytest.mark.mpi
def test_stress_energy_and_momentum_of_a_state(run, tmp_path):
    level = run.levels[1]
    results = results_on((1, 2), computed, str(run.path), str(tmp_path / "state.xdmf"))
    x, mesh = level.positions(STEP), level.mesh
    F = np.einsum("mci,mcj->mij", x[level.cells], mesh.hat_gradients)
    J, mu, lmbda = np.linalg.det(F), *(values[level.bodies, None, None] for values in lame(np.array(YOUNG), POISSON))
    stresses = mu * (F @ F.transpose(0, 2, 1) - np.eye(2)) + lmbda * np.log(J)[:, None, None] * np.eye(2)
    stresses /= J[:, None, None]
    assert np.abs(stresses).max() > 50.0  # Pa: the ground has been hit
    momentum = (mesh.volumes * level.velocities(STEP)[level.cells].mean(axis=1)[:, 1]).sum()
    elastic = next(record["energy"]["elastic"] for record in level.log if record["step"] == STEP)
    for found in results:
        np.testing.assert_allclose(found["stresses"], stresses, rtol=0.0, atol=1e-10 * np.abs(stresses).max())
        assert float(found["energy"]) == pytest.approx(elastic, rel=1e-10)
        assert float(found["momentum"]) == pytest.approx(momentum, rel=1e-10)
    with h5py.File(tmp_path / "state.h5") as file:  # of the two ranks
        written = np.array(file["Function/displacement/0"])[:, :2]
    order = lambda values: values[np.lexsort(values.T)]
    np.testing.assert_array_equal(order(written), order(x - level.rest))


def test_the_space_is_made_once_for_a_communicator(run):
    level = run.levels[0]
    alone = level.space(MPI.COMM_SELF)
    assert alone is level.space(MPI.COMM_SELF) is not level.space()
    u = level.displacement(STEP)
    assert u.function_space is level.space().V and u.function_space.mesh is level.space().domain
    np.testing.assert_array_equal(level.space().to_input(u.x.array.reshape(-1, 2)), level.positions(STEP) - level.rest)


def test_a_state_that_is_missing(run):
    with pytest.raises(pdvol.InputError, match="usable states"):
        run.levels[1].displacement(STEP + 1)
