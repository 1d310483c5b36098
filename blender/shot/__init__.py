"""What is to be simulated, as plain data, and the files that say it to pdvol. Nothing here knows Blender."""
