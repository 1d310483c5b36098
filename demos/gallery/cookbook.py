"""`./run python -m demos.gallery.cookbook [NAME ...]`: run the scenes of docs/cookbook.md, and draw its pictures."""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pdvol

PAGE = Path(__file__).resolve().parents[2] / "docs" / "cookbook.md"
PARTS = re.compile(r"```python\n(.*?)```\s+!\[[^]]*\]\((pictures/cookbook/(\w+)\.png)\)", re.DOTALL)


def main(names: list[str]) -> None:
    """Write a picture for each scene, or for those of these names."""
    for code, picture, name in PARTS.findall(PAGE.read_text(encoding="utf-8")):
        if names and name not in names:
            continue
        found: dict = {"__name__": name}
        exec(compile(code, f"<{PAGE.name}: {name}>", "exec"), found)
        (PAGE.parent / picture).parent.mkdir(exist_ok=True)
        with TemporaryDirectory() as folder:
            run = pdvol.run(found["scene"](), Path(folder) / name)
            pdvol.picture(run, width=260).save(PAGE.parent / picture, optimize=True)
        print(picture)


if __name__ == "__main__":
    main(sys.argv[1:])
