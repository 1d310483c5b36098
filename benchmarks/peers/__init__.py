"""How fast is a step, and where does the time go? Scenes that STARK and IPC ran on the same meshes."""
