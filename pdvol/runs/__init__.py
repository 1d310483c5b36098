"""Runs: a shot, its levels and its run folder, brought together from all stages."""
