"""pdvol at work: processes, what they have reached, and what is made of it for Blender. Nothing here knows Blender."""
