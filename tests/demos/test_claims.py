"""The demos of the gallery do what they claim, run small here; the pages of the repository say so for the full ones."""

import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from demos.gallery import __main__ as gallery
from demos.gallery.__main__ import PAGES, main
from demos.gallery.entries import DEMOS
from demos.gallery.film import FRAMES_PER_SECOND, TILE, film_frames, fit_film, fit_picture
from demos.gallery.page import TO_WRITE
from demos.gallery.shots import commits, costs, read_costs, write_costs
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import claims, commit, simulate_small
from pdvol import open_run
from pdvol.cli import run
from pdvol.measure.verify import verify_run

WITHOUT_CONTACT = {"twist"}
QUICK = {"ball_on_spike", "coil", "melt", "peel", "rope_drop", "twist", "worm"}
"""Entries that take a second or three: one of each kind of claim."""
BY_NAME = {entry.name: entry for entry in ENTRIES}


@pytest.mark.parametrize(
    "entry", [pytest.param(e, id=e.name, marks=() if e.name in QUICK else pytest.mark.slow) for e in ENTRIES]
)
def test_the_claim_holds_on_small_levels(entry, tmp_path):
    stored = simulate_small(entry, tmp_path / "run")
    assert [level.steps for level in stored.levels] == [stored.info["steps"] + 1] * 2
    assert verify_run(tmp_path / "run") == []
    touching = [max(record["contacts"] for record in level.log) > 0 for level in stored.levels]
    assert touching == [entry.name not in WITHOUT_CONTACT] * 2
    found = claims(entry, stored)
    assert found and [sentence for sentence, holds in found if not holds] == []
    assert read_costs(entry, tmp_path) == {}, "costs are kept from here on"
    made = {"commits": ["57d0d06" + "0" * 33, "0a4d02b" + "1" * 33]}
    write_costs(stored, stored, made, {"commits": ["886b61d" + "2" * 33]}, tmp_path / f"{entry.name}.json")
    kept = read_costs(entry, tmp_path)
    assert kept["levels"] == kept["direct"] == costs(stored)
    assert (commits(kept["made"]), commits(kept["made_directly"])) == ("57d0d06, 0a4d02b", "886b61d")
    assert [x["vertices"] for x in kept["levels"]] == [len(level.rest) for level in stored.levels]
    assert kept["levels"][1]["newton"] == np.mean([r["newton_iterations"] for r in stored.levels[1].log])


def test_a_claim_fails_where_levels_fall_to_different_sides(tmp_path):
    # Simulated on their own, levels 0 and 1 end at -0.39 and +0.52 m.
    words = ["--method", "direct", "--levels", "0:1", "--no-picture", "--no-xdmf", "--out", str(tmp_path / "run")]
    assert run(["run", str(DEMOS / "ball_on_spike.py"), *words]) == 0
    assert not any(holds for _, holds in claims(BY_NAME["ball_on_spike"], open_run(tmp_path / "run")))


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_the_page_is_there_and_its_film_is_small(entry):
    text = (PAGES / f"{entry.name}.md").read_text()
    assert "Does not hold" not in text and "0 in " in text and TO_WRITE not in text
    assert f"({entry.name}.md)" in (PAGES / "README.md").read_text()
    if not (PAGES / "sheet.png").is_file():
        pytest.skip("a source archive has neither pictures nor films")
    for name in re.findall(r"\]\(([^)#]+)", text):
        assert (PAGES / name).exists(), name
    assert f"({entry.name}.webp)" in text
    assert (PAGES / f"{entry.name}.webp").stat().st_size <= entry.most


@pytest.mark.slow
def test_a_page_is_made_from_a_stored_run(tmp_path, monkeypatch, capsys):
    pytest.importorskip("imageio_ffmpeg")
    pages, runs = tmp_path / "pages", tmp_path / "runs"
    monkeypatch.setattr(gallery, "PAGES", pages)
    melt = BY_NAME["melt"]
    small = replace(melt, settings=melt.small, size=(640, 480), most=10**6, direct=True, beside=True)
    monkeypatch.setattr(gallery, "ENTRIES", (small,))
    assert main(["melt", "--runs", str(runs)]) == 0
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.suffix in (".md", ".html")}
    assert made == {"pages/README.md", "pages/melt.md", "runs/melt.html"}
    text = (pages / "melt.md").read_text()
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in text.splitlines() if "|" in row]
    rows = {name: values for name, *values in cells}
    assert rows["vertices"] == [f"{len(x.rest)}" for x in open_run(runs / "melt").levels]
    assert "\nIntersections: 0 in 76 states.\n" in text
    own, alone = rows["at most from level 0"], rows["by `--method direct`"]
    assert own[0] == alone[0] == "" and own[1] != alone[1] and "m" in alone[1]
    assert open_run(runs / "melt_direct").info["method"] == "direct"
    with Image.open(pages / "melt.webp") as film:
        assert film.size == small.size and film.n_frames > 30
    with Image.open(pages / "sheet.png") as sheet:
        assert sheet.size[0] == TILE[0]
    assert "Made by `./run pdvol run demos/melt.py" in text
    assert f" at {commit()[:7]} on " in text or not commit()
    # The second time nothing is simulated; a claim that does not hold is said, and is an error.
    before = (runs / "melt" / "log.jsonl").stat().st_mtime_ns
    monkeypatch.setattr(gallery, "claims", lambda entry, run: [("It stays a cube.", False)])
    drawn = (pages / "melt.webp").stat().st_mtime_ns
    assert main(["melt", "--no-film", "--runs", str(runs)]) == 1
    assert (pages / "melt.webp").stat().st_mtime_ns == drawn
    assert (runs / "melt" / "log.jsonl").stat().st_mtime_ns == before
    assert "melt: does not hold: It stays a cube." in capsys.readouterr().err
    text = (pages / "melt.md").read_text()
    assert "- **Does not hold:** It stays a cube." in text
    # Words above a film are written by hand, and stay.
    assert f"# A tower melts and sets\n\n{TO_WRITE}\n\n![" in text
    (pages / "melt.md").write_text(text.replace(TO_WRITE, "Look at\nthe top."))
    assert main(["melt", "--no-film", "--runs", str(runs)]) == 1
    assert "sets\n\nLook at\nthe top.\n\n![" in (pages / "melt.md").read_text()


def test_frames_of_a_film():
    rate = FRAMES_PER_SECOND
    real, slow = film_frames(100, 0.01, None), film_frames(100, 0.01, (0.2, 0.5))
    assert real[0] == slow[0] == 0 and real[-1] == slow[-1] == 100
    assert real.index(100) == pytest.approx(1.0 * rate, abs=1)
    assert [step for step in slow if 20 <= step < 50] == list(range(20, 50)), "each state once"
    assert slow.index(100) == pytest.approx(0.7 * rate + 30, abs=2)
    assert slow == sorted(slow)
    assert film_frames(100, 0.05, (0.2, 0.5)) == film_frames(100, 0.05, None), "nothing between the states to show"


def test_films_and_pictures_are_made_small(tmp_path):
    random = np.random.default_rng(0)
    frames = [Image.fromarray(random.integers(0, 256, (60, 1200, 3), dtype=np.uint8)) for _ in range(13)]
    film, picture = tmp_path / "film.webp", tmp_path / "picture.png"
    frames[0].save(film, save_all=True, append_images=frames[1:], duration=[40] * 12 + [700])
    whole = film.read_bytes()
    assert fit_film(film, len(whole)).read_bytes() == whole, "it is small enough"
    with Image.open(fit_film(film, 90_000)) as found:
        assert film.stat().st_size <= 90_000 and found.width < 1200 and found.n_frames < 13
        times = []
        for k in range(found.n_frames):
            found.seek(k)
            found.load()
            times.append(found.info["duration"])
    assert sum(times) == 12 * 40 + 700 and times[-1] >= 700, "no time is lost"
    frames[0].save(picture)
    before = picture.stat().st_size
    with Image.open(fit_picture(picture)) as found:
        assert found.width == 880 and found.mode == "P" and picture.stat().st_size < before


def test_a_name_that_is_not_there(capsys):
    assert main(["bunny"]) == 2
    assert "there is no bunny; choose of ring_throw" in capsys.readouterr().err
