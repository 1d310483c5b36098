"""Scripts that are written beside an export and open it in the other program's own Python.

Their text is `pdvol/studio/export/NAME.txt`, where one line stands for the values that belong to the export.
"""

from pathlib import Path
from typing import Any

from pdvol.errors import SimulationError
from pdvol.store.files import write_bytes

VALUES_LINE = "# <values>\n"  # of a script's text: the export's values take its place


def write_script(out: Path, name: str, **values: Any) -> Path:
    """Write `out/NAME.py` with the values as assignments, and `WRITTEN_TO`, the folder; returns its path.
    SimulationError: the disk is full.
    """
    text = Path(__file__).with_name(f"{name}.txt").read_text()
    assignments = "".join(f"{key} = {value!r}\n" for key, value in {**values, "WRITTEN_TO": str(out.resolve())}.items())
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SimulationError(f"cannot write {out}: {error.strerror}") from error
    path = out / f"{name}.py"
    write_bytes(path, text.replace(VALUES_LINE, assignments).encode())
    return path
