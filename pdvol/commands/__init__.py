"""What the commands beside `run` do: look at scenes and meshes before a run, and at what a run has stored."""
