"""`pdvol.wedge`: variations of a scene from a script or a notebook, as a table with pictures."""

import base64
import html
import io
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from PIL import Image

from pdvol.errors import InputError, PdvolError
from pdvol.processes import cores
from pdvol.runs.api import run
from pdvol.runs.runner import refine_run
from pdvol.runs.scene_file import Shot, load_shot
from pdvol.scene import Scene
from pdvol.store.reader import Run, open_run
from pdvol.studio.draw.picture import picture
from pdvol.studio.draw.sheet import sheet_image
from pdvol.studio.wedge.jobs import Outcome
from pdvol.studio.wedge.pick import chosen_run, take_out
from pdvol.studio.wedge.results import cell_text, table, tiles
from pdvol.studio.wedge.results import progress as progress_of
from pdvol.studio.wedge.scores import Score, chosen_scores
from pdvol.studio.wedge.variation import Variation
from pdvol.studio.wedge.vary import TAKEN, Vary, chosen_variations, parsed_varies
from pdvol.studio.wedge.wedge import Wedge, stored_runs
from pdvol.studio.workers import Workers

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
    variations = chosen_variations([_vary(name, values) for name, values in (vary or {}).items()], sample, jitter, seed)
    shot = _planned(scene, variations[0], steps) if callable(scene) else load_shot(scene, None, steps)
    functions: dict[str, Score] = {}
    for score in scores:
        functions |= chosen_scores([score], shot) if isinstance(score, str) else {score.__name__: score}
    temporary = tempfile.TemporaryDirectory(prefix="pdvol_") if out is None else None
    folder = Path(temporary.name if temporary else str(out))
    if shot is None or shot.file is None:
        made = Wedge(folder, {"scene": getattr(scene, "__qualname__", "scene"), "steps": steps}, functions)
    else:
        made = Wedge.of(shot, folder, functions)
    with made.taken():
        numbers = made.add(variations)
        with progress_of(len(numbers)) if progress else nullcontext(lambda *_: None) as report:
            if callable(scene):
                made.take(_run_here(scene, dict(zip(numbers, variations, strict=True)), made, steps), report)
            else:
                with closing(Workers(jobs or cores())) as workers:
                    made.run(numbers, workers, report)
        return WedgeTable(folder, made.grouped(), scene, steps, temporary)


def _vary(name: str, values: Sequence | str) -> Vary:
    if isinstance(values, str):
        return parsed_varies([f"{name}={values}"], TAKEN)[0]
    if len(values) == 0:
        raise InputError(f"vary: {name} has no values")
    return Vary(name, tuple(value.item() if hasattr(value, "item") else value for value in values))


def _planned(scene: Callable[..., Scene], variation: Variation, steps: int | None) -> Shot | None:
    """A variation of a scene in memory; None where it cannot be made: it will be a row with its reason."""
    with suppress(PdvolError):
        made = scene(**dict(variation.changes))
        return Shot(None, {}, made if steps is None else replace(made, steps=steps))
    return None


def _run_here(
    scene: Callable[..., Scene], variations: Mapping[int, Variation], made: Wedge, steps: int | None
) -> Iterator[Outcome]:
    """Variations of a scene in memory, which no other process can load."""
    for number, variation in variations.items():
        job, begin = made.job(number), time.monotonic()
        try:
            run(scene(**dict(variation.changes)), job.out, levels=0, steps=steps, resume=job.out.exists())
            yield Outcome(job, "done", seconds=time.monotonic() - begin)
        except PdvolError as error:
            yield Outcome(job, "failed", " ".join(str(error).split()))


@dataclass(eq=False, repr=False)
class WedgeTable:
    """The result of `pdvol.wedge`. A notebook shows it as a table with pictures.

    Attributes
    ----------
    folder : of the wedge; a temporary one is removed with this object
    entries : as `variations` of wedge.json, sorted by the first score
    scene : the scene file or function
    steps : number of time steps, instead of the scene's
    temporary : the folder's owner, which removes it with this object; None where it is kept
    """

    folder: Path
    entries: Sequence[dict[str, Any]]
    scene: str | Path | Callable[..., Scene]
    steps: int | None
    temporary: tempfile.TemporaryDirectory | None

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
        return open_run(chosen_run(self.folder, str(number))[0])

    def sheet(self) -> Image.Image:
        """All variations in one picture."""
        with tempfile.TemporaryDirectory(prefix="pdvol_") as folder:
            drawn = tiles(self.entries, stored_runs(self.folder, self.entries))
            with Image.open(sheet_image(drawn, Path(folder) / "sheet.png")) as image:
                return image.convert("RGB")

    def pick(self, number: int, out: str | Path, to: int | None = None) -> Run:
        """Copy a variation's run into another folder, and refine it up to level `to`.

        Raises
        ------
        InputError
            As `run`; the folder holds something else; there is no such level.
        """
        source, entry = chosen_run(self.folder, str(number))
        take_out(source, Path(out))
        if to is not None and callable(self.scene):
            changes = dict(Variation.from_json(entry).changes)
            return run(self.scene(**changes), out, levels=to, steps=self.steps, resume=True)
        return open_run(out if to is None else refine_run(out, to))

    def _repr_html_(self) -> str:
        rows, shown = self.table, stored_runs(self.folder, self.entries[:MOST_THUMBNAILS])
        head = "".join(f"<th>{html.escape(name)}</th>" for name in ["", *rows[0]] if rows)
        pictures = [_thumbnail(stored) if stored else "" for stored in shown] + [""] * (len(rows) - len(shown))
        lines = [
            f"<tr><td>{image}</td>{''.join(f'<td>{html.escape(cell_text(v))}</td>' for v in row.values())}</tr>"
            for image, row in zip(pictures, rows, strict=True)
        ]
        return f"<table><tr>{head}</tr>{''.join(lines)}</table>"


def _thumbnail(stored: Run) -> str:
    """The end of a run, as an image within a page."""
    buffer = io.BytesIO()
    picture(stored, [0], [stored.levels[0].steps - 1], THUMBNAIL_WIDTH).save(buffer, "PNG")
    return f'<img src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}">'
