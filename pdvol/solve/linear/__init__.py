"""Linear systems of Newton's method: the matrix, its solvers and preconditioners."""
