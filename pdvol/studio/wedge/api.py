"""`pdvol.wedge`: variations of a scene from a script or a notebook, as a table with pictures."""

import base64
import html
import io
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image
from tqdm import tqdm

from pdvol.errors import InputError, PdvolError
from pdvol.processes import cores
from pdvol.runs.api import run
from pdvol.runs.notebook_text import progress_stream
from pdvol.runs.runner import refine_run
from pdvol.runs.scene_file import load_shot
from pdvol.scene import Scene
from pdvol.store.reader import Run, open_run
from pdvol.studio.draw.picture import picture
from pdvol.studio.variations.executors import Workers
from pdvol.studio.variations.variation import Variation
from pdvol.studio.variations.vary import Vary, parsed_varies
from pdvol.studio.wedge.pick import take_out
from pdvol.studio.wedge.progress import WedgeProgress
from pdvol.studio.wedge.results import cell_text, default_sort, table, tiles
from pdvol.studio.wedge.sampling import TAKEN, chosen_variations
from pdvol.studio.wedge.scores import Score, chosen_scores
from pdvol.studio.wedge.wedge import Wedge, done_runs, group, new_entry, ordered, scored

MOST_THUMBNAILS = 48  # of a table in a notebook
THUMBNAIL_WIDTH = 140  # pixels, of one of them


def wedge(
    scene: str | Path | Callable[..., Scene],
    vary: Mapping[str, Sequence | str] | None = None,
    out: str | Path | None = None,
    scores: Sequence[str | Score] = (),
    sample: int | None = None,
    jitter: float | None = None,
    steps: int | None = None,
    jobs: int | None = None,
    seed: int = 0,
    progress: bool = False,
) -> "WedgeTable":
    """Make variations of a scene on level 0.

    Parameters
    ----------
    scene : a scene file, whose variations run side by side in processes; or a function that makes a scene, whose
        variations run in this process one after the other
    vary : values of each parameter: a list of them, or text, `"A:B:N"` for N values from A to B, `"A:B"` for a range
        of a sample
    out : folder of the wedge; a temporary one, removed with the result, when None
    scores : functions of a run, the larger the better, or their texts: `'upright("bear")'`
    sample : number of variations that fill the ranges evenly; all combinations when None
    jitter : [m/s] a small random velocity of this speed is added to each body's initial one
    steps : number of time steps, instead of the scene's
    jobs : runs at a time; one per core when None
    seed : of the sample
    progress : show how many have ended

    Raises
    ------
    InputError
        Something in the arguments is wrong. A variation that fails is a row with its reason.
    """
    varies = [_vary(name, values) for name, values in (vary or {}).items()]
    variations = chosen_variations(varies, sample, jitter, seed)
    temporary = tempfile.TemporaryDirectory(prefix="pdvol_") if out is None else None
    folder = Path(temporary.name if temporary else str(out))
    file = None if callable(scene) else Path(scene)
    functions = _functions(scores, file)
    if callable(scene):
        entries = _run_here(scene, variations, folder, functions, steps, progress)
    else:
        made, workers = Wedge(load_shot(scene, None, steps), folder, functions), Workers(jobs or cores())
        try:
            with made.taken():
                numbers = made.add(variations)
                watch = WedgeProgress(len(numbers), made.out / "wedge.log") if progress else None
                made.run(numbers, workers, watch.ended if watch else lambda *_: None)
                if watch:
                    watch.close()
                entries = made.entries
        finally:
            workers.close()
    group(entries, done_runs(folder, entries))
    return WedgeTable(folder, ordered(entries, default_sort(entries)), scene, steps, temporary)


def _vary(name: str, values: Sequence | str) -> Vary:
    if isinstance(values, str):
        return parsed_varies([f"{name}={values}"], TAKEN)[0]
    if len(values) == 0:
        raise InputError(f"vary: {name} has no values")
    return Vary(name, tuple(value.item() if hasattr(value, "item") else value for value in values))


def _functions(scores: Sequence[str | Score], file: Path | None) -> dict[str, Score]:
    found: dict[str, Score] = {}
    for score in scores:
        found |= chosen_scores([score], file) if isinstance(score, str) else {score.__name__: score}
    return found


def _run_here(
    scene: Callable[..., Scene],
    variations: Sequence[Variation],
    folder: Path,
    scores: Mapping[str, Score],
    steps: int | None,
    progress: bool,
) -> list[dict[str, Any]]:
    """Variations of a scene in memory, which no other process can load."""
    entries = []
    shown = tqdm(variations, desc="wedge", unit="run", file=progress_stream()) if progress else variations
    for number, variation in enumerate(shown):
        entry, where = new_entry(number, variation), folder / "runs" / variation.name
        try:
            run(scene(**dict(variation.changes)), where, levels=0, steps=steps, resume=where.exists())
            entry["state"] = "done"
        except PdvolError as error:
            entry |= {"state": "failed", "reason": " ".join(str(error).split())}
        entry["scores"] = scored(where, scores) if entry["state"] == "done" else dict.fromkeys(scores)
        entries.append(entry)
    return entries


class WedgeTable:
    """The result of `pdvol.wedge`. A notebook shows it as a table with pictures.

    Parameters
    ----------
    folder : of the wedge
    entries : as `variations` of wedge.json, sorted by the first score
    scene : the scene file or function
    steps : number of time steps, instead of the scene's
    temporary : the folder's owner, which removes it with this object; None where it is kept

    Attributes
    ----------
    folder : of the wedge; a temporary one is removed with this object
    entries : as `variations` of wedge.json, sorted by the first score
    """

    def __init__(
        self,
        folder: Path,
        entries: Sequence[dict[str, Any]],
        scene: str | Path | Callable[..., Scene],
        steps: int | None,
        temporary: tempfile.TemporaryDirectory | None,
    ):
        self.folder, self.entries = folder, entries
        self._scene, self._steps, self._temporary = scene, steps, temporary

    @property
    def table(self) -> list[dict[str, Any]]:
        """A row for each variation: `number`, parameters, scores, `cluster` and `state`."""
        return table(self.entries)

    def run(self, number: int) -> Run:
        """The stored run of a variation.

        Raises
        ------
        InputError
            There is no such number, or its run is not done.
        """
        entry = next((entry for entry in self.entries if entry["number"] == number), None)
        if entry is None:
            raise InputError(f"there is no variation {number}; there are 0 to {len(self.entries) - 1}")
        if entry["state"] != "done":
            raise InputError(f"variation {number} is {entry['state']}: {entry['reason']}")
        return open_run(self.folder / "runs" / entry["name"])

    def sheet(self, columns: int | None = None) -> Image.Image:
        """All variations in one picture."""
        from pdvol.studio.draw.sheet import sheet_image

        runs = done_runs(self.folder, self.entries)
        with tempfile.TemporaryDirectory(prefix="pdvol_") as folder:
            file = sheet_image(tiles(self.entries, runs), Path(folder) / "sheet.png", columns)
            with Image.open(file) as drawn:
                return drawn.convert("RGB")

    def pick(self, number: int, out: str | Path, to: int | None = None) -> Run:
        """Copy a variation's run into a folder of its own, and refine it up to level `to`.

        Raises
        ------
        InputError
            As `run`; the folder holds something else; there is no such level.
        """
        stored = self.run(number)
        folder = take_out(stored.path, Path(out))
        if to is None:
            return open_run(folder)
        if not callable(self._scene):
            return open_run(refine_run(folder, to))
        entry = next(entry for entry in self.entries if entry["number"] == number)
        changes = dict(Variation.from_json({"changes": entry["changes"], "method": "progressive"}).changes)
        return run(self._scene(**changes), folder, levels=to, steps=self._steps, resume=True)

    def _repr_html_(self) -> str:
        rows = self.table
        head = "".join(f"<th>{html.escape(name)}</th>" for name in ["", *rows[0]] if rows)
        lines = []
        for place, (row, entry) in enumerate(zip(rows, self.entries, strict=True)):
            shown = _thumbnail(self.run(row["number"])) if entry["state"] == "done" and place < MOST_THUMBNAILS else ""
            lines.append(f"<td>{shown}</td>" + "".join(f"<td>{html.escape(cell_text(v))}</td>" for v in row.values()))
        return f"<table><tr>{head}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _thumbnail(stored: Run) -> str:
    """The end of a run, as an image within a page."""
    buffer = io.BytesIO()
    last = stored.levels[0].steps - 1
    picture(stored, [0], [last], THUMBNAIL_WIDTH).save(buffer, "PNG")
    return f'<img src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}">'
