"""Implicit Euler and BDF2: their order, their damping, and what they give at one time step."""
