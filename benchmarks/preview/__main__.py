"""How right is a preview? A swinging bar and a thrown ape by old and new integrators and elements, beside the truth.

    ./run python -m benchmarks.preview [--out runs/preview]

It makes the films, the curves and the table of docs/how_right.md. Finished runs in `--out` are used again.
"""

import sys
from pathlib import Path

from benchmarks.common.study import command
from benchmarks.preview import page


@command("preview", __doc__, {"--out": {"type": Path, "default": Path("runs/preview"), "help": "where runs are kept"}})
def main(options) -> None:
    """Runs the command; returns its exit code."""
    page.write(options.out)


if __name__ == "__main__":
    sys.exit(main())
