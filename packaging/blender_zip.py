"""Blender's extension as a zip that Blender installs:  python packaging/blender_zip.py [OUT]

OUT is build/pdvol-VERSION.zip where it is left out. The same files give the same zip. It has the wheel that dist/ has,
which the extension installs: python -m build -w
"""

import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "blender"
MANIFEST = "blender_manifest.toml"
EPOCH = (2020, 1, 1, 0, 0, 0)  # of all files in the zip


def files() -> list[Path]:
    """What the extension consists of: its modules, its manifest, the licence, and the wheel of its version."""
    wheels = sorted((ROOT / "dist").glob(f"pdvol-{version()}-*.whl"))
    return [SOURCE / MANIFEST, *sorted(SOURCE.rglob("*.py")), ROOT / "COPYING", ROOT / "COPYING.LESSER", *wheels]


def version() -> str:
    """That of the extension."""
    return str(tomllib.loads((SOURCE / MANIFEST).read_text())["version"])


def write(out: Path) -> Path:
    """Write the zip; its path."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(out, "w") as made:
        for file in files():
            name = file.relative_to(SOURCE).as_posix() if file.is_relative_to(SOURCE) else file.name
            info = zipfile.ZipInfo(name, EPOCH)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            made.writestr(info, file.read_bytes())
    return out


def main() -> None:
    """Write the zip, and print its path."""
    print(write(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "build" / f"pdvol-{version()}.zip"))


if __name__ == "__main__":
    main()
