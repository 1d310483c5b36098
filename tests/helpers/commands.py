"""pdvol's command in a process of its own."""

import sys
from pathlib import Path

PDVOL = [sys.executable, "-c", "import pdvol; pdvol.main()"]
WITHOUT_PICTURE = [sys.executable, str(Path(__file__).with_name("without_picture.py"))]
"""As `PDVOL`, but without the picture that ends a run: it takes longer than the runs of most tests."""
SAFETY = 1800.0
"""Seconds after which a process is taken to hang. No test depends on it: a busy machine needs a small part of it."""
