"""Contact and friction between surfaces, obstacles and half-spaces (Li et al. 2020, 2023)."""
