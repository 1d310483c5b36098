"""A run folder: states, log and description, written so that they survive a kill, and read back as arrays."""
