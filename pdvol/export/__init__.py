"""A stored run in the formats of other software. Nothing here knows a solver."""
