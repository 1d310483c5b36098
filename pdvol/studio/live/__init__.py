"""A local page on which level 0 of a scene runs while one looks."""
