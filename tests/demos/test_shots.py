"""What levels of shots cost, how near bodies come, and which pages are older than the solver."""

import hashlib
import re
import zlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from benchmarks.common.commits import MissingObject
from benchmarks.common.tables import number
from demos.gallery import films
from demos.gallery.__main__ import PAGES, main
from demos.gallery.check import History, table_of_ages
from demos.gallery.entries import Entry, Variant
from demos.gallery.meeting import gaps_between
from demos.gallery.shots import costs, read_costs, table_of_shots, write_costs
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import commit, settings_by, simulate_small
from shapes import box

MOST_BYTES = 6e6  # of a film: the repository carries them
MELT = next(entry for entry in ENTRIES if entry.name == "melt")
PAGE = """# {title}

| | level 0 | level 1 |
| --- | --- | --- |
| vertices, cells | 60, 200 | 1,142, 6,034 |
| CPU seconds a step, mean (most) | 0.0030 (0.0082) | {seconds} (0.9) |
| Newton iterations a step, mean (most) | 4.5 (11) | 6.0 (1,016) |
| most contacts | 3 | 1,031 |

Made by `./run pdvol run demos/{name}.py` at commit {commits} on one core of AMD EPYC, 2 cores, load 1.3.
"""


def page(folder, name, seconds="0.30", commits="57d0d06"):
    (folder / f"{name}.md").write_text(PAGE.format(title=name, name=name, seconds=seconds, commits=commits))
    return Entry(name, name.capitalize(), "", {}, paper="3" if name == "large" else "")


def test_costs_are_those_of_the_page_or_kept_beside_it(tmp_path):
    page(tmp_path, "drop", commits="57d0d06, 0a4d02b (by the direct method: 886b61d)")
    found = read_costs(tmp_path / "drop.md")
    assert (found["commits"], found["direct_commits"]) == ("57d0d06, 0a4d02b", "886b61d")
    assert found["machine"] == "AMD EPYC, 2 cores, load 1"
    assert [(x["vertices"], x["cells"], x["cpu"], x["newton"], x["contacts"]) for x in found["levels"]] == [
        (60, 200, 0.003, 4.5, 3),
        (1142, 6034, 0.3, 6.0, 1031),
    ]
    assert read_costs(tmp_path / "drop.md", "drop_stiff")["levels"] == [], "nothing is known of a variant"
    run = simulate_small(MELT, tmp_path / "run")
    made = {"commits": ["57d0d06" + "0" * 33, "0a4d02b" + "1" * 33]}
    write_costs(run, run, made, {"commits": ["886b61d" + "2" * 33]}, tmp_path / "drop.json")
    kept = read_costs(tmp_path / "drop.md")
    assert kept["levels"] == kept["direct"] == costs(run) and kept["direct_commits"] == "886b61d"
    assert [x["vertices"] for x in kept["levels"]] == [len(level.rest) for level in run.levels]
    assert kept["levels"][1]["newton"] == np.mean([r["newton_iterations"] for r in run.levels[1].log])
    page(tmp_path, "drop", commits="886b61d")
    assert read_costs(tmp_path / "drop.md")["levels"][0]["vertices"] == 60, "what is kept is of another run"


def test_the_table_of_shots(tmp_path):
    small, large = page(tmp_path, "small", "0.015"), page(tmp_path, "large")
    lines = table_of_shots((small, large, MELT), tmp_path).splitlines()
    assert lines[2] == "| [Large](large.md) | 3 | 60, 1,142 | 0.0030, 0.30 | 100 | 4.5, 6.0 |  | 57d0d06 |"
    assert lines[3].startswith("| [Small](small.md) |  | 60, 1,142 | 0.0030, 0.015 | 5.0 |")
    assert lines[-1] == (
        "In 1 of 2 rows the finest level takes 10 times as long as level 0 or longer, up to 100 times."
        " Of the others these have less to save: Small (5.0)."
    )


def test_the_gallery_s_table_is_that_of_its_pages():
    text = (PAGES / "README.md").read_text()
    assert table_of_shots(ENTRIES, PAGES) in text
    for entry in ENTRIES:
        assert f"| [{entry.title}]({entry.name}.md) | {entry.paper} |" in text


@pytest.mark.parametrize("kept", sorted(PAGES.glob("*.json")), ids=lambda path: path.stem)
def test_what_is_kept_is_what_the_page_says(kept):
    """To the digits that the page shows."""
    entry = next(e for e in ENTRIES if kept.stem in (e.name, *(e.varied(v).name for v in e.variants)))
    text, found = (PAGES / f"{entry.name}.md").read_text(), read_costs(PAGES / f"{entry.name}.md", kept.stem)
    rows = [line for line in text.splitlines() if line.startswith("| vertices, cells |")]
    assert (
        "| vertices, cells | " + " | ".join(f"{x['vertices']:,}, {x['cells']:,}" for x in found["levels"]) + " |"
        in rows
    )
    rows = [line for line in text.splitlines() if line.startswith("| CPU seconds a step")]
    assert any(all(f" {number(x['cpu'], 2)} (" in row for x in found["levels"]) for row in rows)


def test_gaps_between_two_bodies():
    """Cubes of 1 m, the upper one 0.1 m above the lower one, and then 0.1 m in it."""
    cube = box(3, 2)
    boundary, n = cube.boundary, len(cube.points)
    level = SimpleNamespace(
        surface=np.vstack([boundary, boundary + n]), mesh=SimpleNamespace(point_bodies=np.repeat([0, 1], n))
    )
    for height, gap in ((1.1, 0.1), (0.9, -0.1)):
        found = gaps_between(level, np.vstack([cube.points + [0.0, 0.0, height], cube.points]), (0, 1))
        assert len(found) == len(np.unique(boundary))
        inside = [g for g in found if g < 0.0]
        assert len(inside) == (gap < 0.0), "only the middle of the lower face is inside"
        assert min(found) == pytest.approx(gap)


def test_a_direct_run_has_no_ties():
    tied = replace(MELT, settings={"consistency": 0.025, "young": 1e4, "feedback": 0.1})
    assert settings_by(tied, "progressive") == tied.settings and settings_by(tied, "direct") == {"young": 1e4}


def test_a_variant_is_the_same_demo():
    entry = replace(MELT, variants=(Variant("stiff", "A stiff one", "More.", {"young": 1e8}),))
    other = entry.varied(entry.variants[0])
    assert (other.name, other.file, other.settings) == ("melt_stiff", MELT.file, {"young": 1e8})
    assert other.title == "A tower melts and sets: A stiff one" and other.variants == ()


class Commits:
    """A repository of loose objects in a folder."""

    def __init__(self, folder):
        self.git = folder / ".git"
        self.git.mkdir(parents=True)

    def object(self, kind, content):
        data = f"{kind} {len(content)}\0".encode() + content
        name = hashlib.sha1(data).hexdigest()
        path = self.git / "objects" / name[:2] / name[2:]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(zlib.compress(data))
        return name

    def tree(self, files):
        entries = b""
        for name, content in sorted(files.items()):
            folder = isinstance(content, dict)
            child = self.tree(content) if folder else self.object("blob", content.encode())
            entries += f"{40000 if folder else 100644} {name}\0".encode() + bytes.fromhex(child)
        return self.object("tree", entries)

    def commit(self, files, *parents):
        lines = [f"tree {self.tree(files)}", *(f"parent {parent}" for parent in parents), "author nobody"]
        name = self.object("commit", ("\n".join(lines) + "\n\nAdd\n").encode())
        (self.git / "HEAD").write_text(name + "\n")
        return name


def files(solver="1", drop="1", page="1"):
    pdvol = {"solve": {"newton.py": solver}, "commands": {"run.py": page}, "runs": {"launcher.py": page}}
    return {"pdvol": pdvol, "forms": {"a.py": "1"}, "demos": {"drop.py": drop}, "docs": {"a.md": page}}


def test_ages_of_pages(tmp_path):
    kept = Commits(tmp_path)
    first = kept.commit(files())
    second = kept.commit(files(drop="2"), first)
    entry = replace(page(tmp_path, "drop", commits=second[:7]), direct=False)

    def row():
        return table_of_ages((entry,), tmp_path, tmp_path).splitlines()[2].strip("| ").split(" | ")

    assert row() == ["drop", second[:7], "-", first[:7], second[:7], "nothing"]
    third = kept.commit(files(drop="2", page="2"), second)
    assert row()[3:] == [first[:7], second[:7], "nothing"], "a change of pages, commands and ranks makes nothing older"
    kept.commit(files(solver="1  # one", drop="2  # two", page="2"), third)
    assert row()[-1] == "nothing", "nor does a comment"
    side = kept.commit(files(solver="2", drop="2"), second)
    kept.commit(files(solver="2", drop="2", page="2"), third, side)
    assert row()[3:] == [side[:7], second[:7], "all numbers (pdvol/solve changed since)"], "a merge is no change"
    assert History(tmp_path).last_change(("pdvol/solve", "forms")) == side
    page(tmp_path, "drop", commits=first[:7])
    assert row()[-1] == "all numbers (pdvol/solve, demos/drop.py changed since)"
    page(tmp_path, "drop", commits="0" * 7)
    assert row()[-1] == "all numbers (its commit is not in this repository)"
    page(tmp_path, "drop", commits=f"{side[:7]} (by the direct method: {first[:7]})")
    entry = replace(entry, direct=True)
    assert row()[-1] == "the direct run (pdvol/solve, demos/drop.py changed since)"
    with pytest.raises(MissingObject):
        table_of_ages((entry,), tmp_path, tmp_path / "docs")


def test_check_says_of_each_page_which_commit_it_is_of(capsys):
    assert main(["--check"]) == (0 if commit() else 2)
    if commit():
        lines = capsys.readouterr().out.splitlines()
        runs = [entry.name for entry in ENTRIES]
        assert set(runs) <= {line.split(" | ")[0].strip("| ") for line in lines}
        assert lines[-1].startswith(f"At commit {commit()[:7]}: ")
    for wrong in ([], ["--check", "melt"]):
        with pytest.raises(SystemExit):
            main(wrong)


def test_films_of_the_page_are_there():
    text = films.PAGE.read_text()
    shown = re.findall(r"\]\(((?:films|gallery)/\w+\.webp)\)", text)
    assert [Path(name).stem for name in shown] == list(films.LOOK)
    assert sum(name.startswith("films/") for name in shown) >= 2 and text.count("At commit ") == len(shown)
    for name in shown:
        assert (films.PAGE.parent / name).stat().st_size < MOST_BYTES
    assert films.main(["bunny"]) == 2


@pytest.mark.slow
def test_a_film_of_level_0_beside_the_finest_one(tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    small = replace(next(entry for entry in ENTRIES if entry.name == "twist"), slow=None)
    monkeypatch.setattr(films, "ENTRIES", (small,))
    monkeypatch.setattr(films, "PAGE", tmp_path / "films.md")
    monkeypatch.setattr(films, "FRAME", (320, 160))
    monkeypatch.setattr(films, "LOOK", {"twist": "Look."})
    simulate_small(small, tmp_path / "runs" / "twist")
    assert films.main(["twist", "--runs", str(tmp_path / "runs")]) == 0
    with Image.open(tmp_path / "films" / "twist.webp") as film:
        assert film.size == (320, 160) and film.n_frames > 10
    text = (tmp_path / "films.md").read_text()
    assert text.count("\n## ") == 1 and "(films/twist.webp)" in text and "Level 1: " in text
    assert films.main(["twist", "--runs", str(tmp_path / "none")]) == 1, "there is no run"
