"""Helpers that tests of several folders share: the grids of hierarchy/shapes.py and the problems of solve/problems.py."""

import sys
from pathlib import Path

sys.path += [str(Path(__file__).parent / folder) for folder in ("hierarchy", "solve")]
