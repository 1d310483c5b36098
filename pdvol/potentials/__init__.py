"""Terms of the incremental potential: value, gradient, filtered Hessian, largest admissible step."""
