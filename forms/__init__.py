"""Pure UFL: no mesh, MPI or PETSc."""
