"""Measures of stored runs: arrays in, numbers out."""
