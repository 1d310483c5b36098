"""Studies in a short form. Their mistakes are in test_rows.py."""

import shutil

import pytest

from benchmarks.ablation import __main__ as ablation
from benchmarks.binding import __main__ as binding
from benchmarks.common import commits
from benchmarks.common.process import REPOSITORY
from benchmarks.divergence import __main__ as divergence
from benchmarks.fronts import __main__ as fronts
from benchmarks.hertz import __main__ as hertz
from benchmarks.live import __main__ as live
from benchmarks.preview import __main__ as preview
from benchmarks.time_order import __main__ as time_order
from browser import CHROMIUM
from pdvol.cli import run
from pdvol.integrate.stepper import Stepper
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.solve import newton


def test_a_rule_that_is_switched_off_costs_iterations_and_comes_back(monkeypatch):
    monkeypatch.setitem(ablation.SHORTER, "mu_10", 20)
    whole, without = ablation.march("mu_10", "all"), ablation.march("mu_10", "predictions")
    assert without[0] > 1.3 * whole[0]
    assert ablation.cell(without, whole).startswith(f"{without[0] / whole[0]:.2f}, ")
    parts = (newton, newton.LinearSolver, Stepper, ContactBarrier, LaggedFriction, ablation.solver)
    before = [dict(vars(part)) for part in parts]
    for rule in set(ablation.RULES) - {"all"}:
        with ablation.RULES[rule]():
            assert [dict(vars(part)) for part in parts] != before, rule
        assert [dict(vars(part)) for part in parts] == before, rule


def test_bindings_have_tables_and_pictures(tmp_path, monkeypatch):
    """Of one small pair: how many weights there are before and after, and that they stay affine."""
    small = binding.Pair("extreme_shapes", 1, 0, (65, 100))
    for name in ("PAIRS", "SIMILAR", "SEAHORSE"):
        monkeypatch.setattr(binding, name, (small,) if name == "PAIRS" else small)
    page = tmp_path / "binding.md"
    page.write_text("before\n<!-- benchmarks.binding: tables -->\n<!-- benchmarks.binding: end -->\nafter\n")
    (tmp_path / "pictures").mkdir()
    monkeypatch.setattr(binding, "PICTURES", tmp_path / "pictures")
    assert binding.main(["--docs", str(page)]) == 0
    assert page.read_text().count("| `extreme_shapes`") == 2 and len(list(tmp_path.glob("pictures/*.png"))) == 2
    columns = len(small.meshes[0].points)
    cells = [cell.strip() for cell in page.read_text().splitlines()[-3].split("|")]
    assert cells[3:5] == ["3", str(columns)] and 3.0 < float(cells[6]) < columns and float(cells[9]) < 1e-10


@pytest.mark.skipif(not any(map(shutil.which, CHROMIUM)), reason="there is no Chromium in PATH")
def test_the_live_page_is_played_and_has_a_table(tmp_path):
    page = tmp_path / "NOTES.md"
    page.write_text("<!-- benchmarks.live: table -->\n<!-- benchmarks.live: end -->\n")
    assert live.main(["ball_on_spike", "--seconds", "1", "--out", str(tmp_path), "--docs", str(page)]) == 0
    cells = [cell.strip() for cell in page.read_text().splitlines()[-2].split("|")]
    assert cells[1:3] == ["`ball_on_spike`", "60"] and min(map(float, cells[3:10])) > 0.0, "steps, factors, delays"


def test_distances_between_levels_have_a_table_and_a_drawing(tmp_path, capsys):
    words = ["--set", "cuts=((4, 1), (8, 2), (12, 3))", "--steps", "4", "--out", str(tmp_path / "run")]
    assert run(["run", str(REPOSITORY / "demos" / "twist.py"), *words]) == 0
    assert divergence.main([str(tmp_path / "run"), "-o", str(tmp_path / "figure.png")]) == 0
    assert "| 2 from 0 | 4 |" in capsys.readouterr().out and (tmp_path / "figure.png").read_bytes()[1:4] == b"PNG"


def test_a_front_has_the_cheapest_settings_for_each_accuracy():
    def point(cost, error, **changes):
        words = ["--levels", "0:1", "--steps", "10", *(w for k, v in changes.items() for w in ("--set", f"{k}={v}"))]
        made = {"run": "x", "method": "progressive", "level": 1, "words": words, "cost": {"cpu": cost}}
        errors = {"end": error, "share": error / 2.0, "outcome": True}
        return made | {"changes": {k: str(v) for k, v in changes.items()}, "errors": errors}

    default = point(10.0, 0.04)
    study = {
        "points": [default, point(4.0, 0.05, tolerance=0.1), point(30.0, 0.004, dt=0.005)],
        "default": default,
        "size": 2.0,
        "levels": [{"vertices": 1200}, {"vertices": 3400}],
        "reference": {"error": 0.001},
        "spread": {"growth": 25.0, "chaotic": True},
        "orders": [{"axis": "dt", "order": 0.97}, {"axis": "dhat", "order": None}],
        "machine": {"processor": "P", "cores": 2},
        "jobs": 2,
    }
    text = fronts.fronts_table({"shot": study, "unfinished": {"points": []}})
    row = next(line for line in text.splitlines() if line.startswith("| shot"))
    assert "1,200, 3,400" in row and "10.0, 4 cm, 2.00%" in row and "25 times, chaotic" in row
    assert "`--set dt=0.005 --steps 10 --levels 0:1`: 4 mm in 300% of the time" in row
    assert "`--set tolerance=0.1 --levels 0:1`: 5 cm in 40% of the time" in row and row.endswith("dt 0.97 |")


def test_refinement_comes_closer_to_hertz():
    """Force balances; with h and dhat halved, errors fall to 0.33 to 0.52. Order 1 is a half."""
    coarse, fine = (hertz.press(n, 0.1, hertz.DHAT / n) for n in (6, 12))
    for row in (coarse, fine):
        assert row["balance"] == pytest.approx(1.0, abs=1e-4)
    for key in hertz.FIGURES:
        assert abs(fine[key] - 1.0) < 0.6 * abs(coarse[key] - 1.0), key
    assert abs(fine["radius"] - 1.0) < 0.03 and abs(fine["pressure"] - 1.0) < 0.03


def test_states_of_two_time_steps_are_those_of_common_times():
    scene = time_order.cantilever()
    coarse, fine = (time_order.states(scene, dt, "bdf2", steps=5)[0] for dt in (time_order.DT, time_order.DT / 5.0))
    assert len(coarse["x"]) == len(fine["x"]) == 5 and fine["newton"] > coarse["newton"] > 0
    assert 0.0 < time_order.over_shot(coarse, fine) < 1e-3


def test_the_page_of_previews_has_what_the_command_makes():
    text, made = preview.DOCS.read_text(), preview.Page(preview.DOCS, "preview", "table").text
    assert made.count(", level ") == 8 and all(kind in made for kind in preview.KINDS)
    for file in (f"how_right_{name}.{ending}" for name in ("bar", "ape") for ending in ("webp", "png")):
        assert f"pictures/{file}" in text and (preview.PICTURES / file).is_file()


def test_files_of_a_commit_are_read_without_git(tmp_path):
    """From this checkout, whose objects a clone has in packs with deltas."""
    if not (REPOSITORY / ".git").exists():
        pytest.skip("not a git checkout")
    found = commits.Repository(REPOSITORY)
    commit = found.head()
    assert found.full(commit[:12]) == commit
    texts = dict(found.files(commit))
    same = [(file := REPOSITORY / path).is_file() and file.read_bytes() == text for path, text in texts.items()]
    assert sum(same) > 0.5 * len(same) > 300  # all but those that are being changed
    found.write(commit, ("forms",), tmp_path / "out")
    written = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.py")}
    assert written == {path for path in texts if path.startswith("forms/") and path.endswith(".py")}
