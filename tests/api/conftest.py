"""The small scene and meshes of this folder's tests, and the derivative check that tests share."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "potentials")]
