"""`pdvol play`: one file from runs, their contact forces, and one line for what cannot be played."""

import pytest

from cli_scenes import FALL, pdvol, write

CHOICES = ("--steps", 6, "--no-picture")


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A small run of two levels whose scene file is there."""
    folder = tmp_path_factory.mktemp("play")
    assert pdvol("run", write(folder / "fall.py", FALL), "--out", folder / "run", *CHOICES) == 0
    return folder / "run"


def test_runs_with_fields_and_levels(shot, tmp_path, capsys):
    assert pdvol("play", shot, "--fields", "strain,contact_force") == 0
    said = capsys.readouterr().out.strip()
    assert said.startswith(f"{shot / 'player.html'}: 2 panes, 0.") and "\n" not in said
    page = (shot / "player.html").read_text()
    assert '<option value="strain">' in page and '<option value="contact_force">' in page
    assert "centre" in page and "<title>fall</title>" in page
    (shot / "player.html").unlink()
    assert pdvol("play", shot, shot, "--levels", "1", "-o", tmp_path / "two.html") == 0
    assert (tmp_path / "two.html").read_text().count('"run, level 1"') == 2


def test_a_long_run_is_thinned_in_one_line_unless_all_is_wanted(shot, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("pdvol.studio.play.panes.MOST_VERTEX_STATES", 100)  # 7 states of 9 and of 25 vertices: 238
    for words, remark in (((), "one state in 3 is in the file"), (("--every", 1), ""), (("--every", 2), "")):
        assert pdvol("play", shot, "-o", tmp_path / "shot.html", "--fields", "strain", *words) == 0
        said = capsys.readouterr().out.strip().splitlines()
        assert len(said) == 1 + bool(remark) and remark in said[-1]
        every = 3 if not words else words[1]
        assert (f"one state in {every}" in (tmp_path / "shot.html").read_text()) == (every > 1)


def test_a_scene_that_is_gone_leaves_out_contact_forces(shot, tmp_path, capsys):
    scene = shot.parent / "fall.py"
    text = scene.read_text()
    scene.unlink()
    try:
        assert pdvol("play", shot, "-o", tmp_path / "a.html", "--fields", "contact_force") == 0
    finally:
        scene.write_text(text)
    assert "without contact forces" in capsys.readouterr().out
    assert "contact_force" not in (tmp_path / "a.html").read_text().split("var THREE=")[0]
