"""`./run docs [OUT]`: docs/ as a static site in OUT (build/site when left out), every warning an error.

./run docs            # build/site/index.html opens without a server
./run docs --links    # asks each external address whether it answers; needs the net, and is no part of the tests
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import build_main

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent


def build(out: Path, builder: str = "html") -> int:
    """Sphinx's exit code: 0 without warnings."""
    with tempfile.TemporaryDirectory(prefix="pdvol_docs_") as trees:
        settings = ["-c", str(HERE), "-d", trees, "-b", builder, "-W", "--keep-going", "-q", "-E"]
        code = build_main([*settings, str(DOCS), str(out)])
    for left in (out / ".buildinfo", out / "objects.inv"):
        left.unlink(missing_ok=True)
    return code


def main() -> int:
    parser = argparse.ArgumentParser(prog="./run docs", description=__doc__.partition("\n")[0])
    parser.add_argument("out", nargs="?", type=Path, default=DOCS.parent / "build" / "site", help="folder of the site")
    parser.add_argument("--links", action="store_true", help="check external links instead")
    options = parser.parse_args()
    if options.links:
        with tempfile.TemporaryDirectory(prefix="pdvol_links_") as folder:
            return build(Path(folder), "linkcheck")
    if options.out.exists():
        if any(options.out.iterdir()) and not (options.out / "searchindex.js").exists():
            print(f"docs: {options.out} is not empty and no site; choose another folder", file=sys.stderr)
            return 2
        shutil.rmtree(options.out)
    code = build(options.out)
    if code == 0:
        print(options.out / "index.html")
    return code


if __name__ == "__main__":
    sys.exit(main())
