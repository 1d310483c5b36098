"""From the shapes of a scene to valid meshes: reading, checks, decimation, tetrahedra and triangles.

Meshers run in processes of their own.
"""
