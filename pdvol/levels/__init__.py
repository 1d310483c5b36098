"""The levels of a scene: distributed spaces, materials of cells, bindings and prolongations between neighbours."""
