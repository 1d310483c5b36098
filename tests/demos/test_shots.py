"""What levels of shots cost, how near bodies come, and which pages are older than the solver."""

from dataclasses import replace

import pytest

from benchmarks.common.tables import number
from demos.gallery.__main__ import PAGES, main
from demos.gallery.check import table_of_ages
from demos.gallery.entries import Entry, Variant
from demos.gallery.shots import read_costs, table_of_shots, write_costs
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import settings_by, simulate_small
from pdvol.store.files import write_json

MELT = next(entry for entry in ENTRIES if entry.name == "melt")


def kept(folder, name, seconds=0.30, made="57d0d06", directly=""):
    """An entry whose costs are kept."""
    sizes = [(60, 0.003, 4.5), (1142, seconds, 6.0)]
    levels = [{"level": k, "vertices": n, "cpu": cpu, "newton": i} for k, (n, cpu, i) in enumerate(sizes)]
    noted = [{"commits": [commit] if commit else []} for commit in (made, directly)]
    found = {"made": noted[0], "levels": levels, "made_directly": noted[1], "direct": levels if directly else []}
    write_json(folder / f"{name}.json", found)
    return Entry(name, name.capitalize(), direct=bool(directly))


def test_the_table_of_shots(tmp_path):
    small, large = kept(tmp_path, "small", 0.015, directly="886b61d"), kept(tmp_path, "large")
    lines = table_of_shots((small, large, MELT), tmp_path).splitlines()
    assert lines[3] == "| [Large](large.md) | 60, 1,142 | 0.0030, 0.30 | 100 |  |"
    assert lines[2] == "| [Small](small.md) | 60, 1,142 | 0.0030, 0.015 | 5.0 | 0.015 |"
    assert lines[-1] == (
        "In 1 of 2 rows the finest level takes 10 times as long as level 0 or longer, up to 100 times. On 1 rows with a"
        " direct run, the refined finest level takes 1.0 to 1.0 times its time, in the median 1.0."
    )


def test_pages_say_what_is_kept():
    """To the digits that a page shows."""
    text = (PAGES / "README.md").read_text()
    assert table_of_shots(ENTRIES, PAGES) in text
    times = text.split("](drop.md) | ")[1].split(" | ")[2]
    assert f"takes [{times} times as long](docs/gallery/" in (PAGES.parents[1] / "README.md").read_text()
    for entry in [row for each in ENTRIES for row in each.rows]:
        assert f"| [{entry.title}](" in text
        page, found = (PAGES / f"{entry.demo or entry.name}.md").read_text(), read_costs(entry, PAGES)
        sizes = " | ".join(f"{x['vertices']:,}" for x in found["levels"])
        assert f"| vertices | {sizes} |" in page
        rows = [line for line in page.splitlines() if line.startswith("| CPU seconds a step")]
        assert any(all(f" {number(x['cpu'], 2)} |" in row for x in found["levels"]) for row in rows), entry.name


def test_a_direct_run_has_no_ties_and_a_variant_is_the_same_demo():
    tied = replace(MELT, settings={"consistency": 0.025, "young": 1e4, "feedback": 0.1})
    assert settings_by(tied, "progressive") == tied.settings and settings_by(tied, "direct") == {"young": 1e4}
    first, other = replace(MELT, variants=(Variant("stiff", "A stiff one", {"young": 1e8}),)).rows
    assert first.name == "melt" and (other.file, other.settings) == (MELT.file, {"young": 1e8})
    assert (other.name, other.title) == ("melt_stiff", "A tower melts and sets: A stiff one") and other.rows == (other,)


def test_check_finds_a_page_that_is_older_than_the_solver(tmp_path):
    entry = replace(MELT, settings=MELT.small)
    run = simulate_small(MELT, tmp_path / "run")
    write_costs(run, run, {"commits": ["57d0d06"]}, {}, tmp_path / "melt.json")
    text, old = table_of_ages([entry], tmp_path)
    assert old == 0 and text.endswith("1 of 1 runs have the numbers of this solver; 0 have older ones.")
    found = read_costs(entry, tmp_path)
    found["levels"][1]["newton"] *= 1.1
    found["direct"][0]["motion"][3][1] += 0.03 * found["levels"][0]["motion"][3][-1]
    write_json(tmp_path / "melt.json", found)
    text, old = table_of_ages([entry], tmp_path)
    assert old == 1 and "| level 1: " in text and "; by `--method direct`: places 0.0" in text


@pytest.mark.parametrize("wrong", [[], ["--chekc"], ["--check", "nonsense"]])
def test_wrong_words_end_with_2(wrong):
    try:
        assert main(wrong) == 2
    except SystemExit as end:
        assert end.code == 2
