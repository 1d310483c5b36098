"""How right is a preview? A swinging bar and a thrown ape by old and new integrators and elements, beside the truth.

    ./run python -m benchmarks.preview [--out runs/preview]

It makes the films, the curves and the table of docs/how_right.md. Finished runs in `--out` are used again.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.common import process
from benchmarks.preview import page
from pdvol import PdvolError


def main(words: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("preview", __doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/preview"), help="where runs are kept")
    options = parser.parse_args(words)
    try:
        page.write(options.out)
    except (process.Mistake, OSError, PdvolError) as error:
        print(f"benchmarks.preview: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
