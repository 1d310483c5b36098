"""Scenes and animated meshes in the files of other software."""
