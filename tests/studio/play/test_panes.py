"""What is shown: levels of runs, variations of a wedge folder, and messages about what cannot be."""

import json
import shutil

import pytest

import runs
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.play.document import player_page
from pdvol.studio.play.panes import Pane, panes_of_run, panes_of_wedge, thinned


def test_one_state_in_some_and_the_last_one(flat_run, monkeypatch):
    run = open_run(flat_run)
    panes = panes_of_run(run)
    assert [(pane.title, pane.level, pane.states) for pane in panes] == [("level 0", 0, 7), ("level 1", 1, 7)]
    assert [pane.title for pane in panes_of_run(run, [1], named=True)] == [f"{run.path.name}, level 1"]
    assert [(pane.lines, pane.steps) for pane in thinned(panes)] == [(pane.lines, list(range(7))) for pane in panes]
    assert [list(pane.steps) for pane in thinned(panes, 4)] == [[0, 4, 6]] * 2
    assert [list(pane.steps) for pane in thinned(panes, 9)] == [[0, 6]] * 2
    assert thinned(panes, 4)[0].lines[-1] == "one state in 4"
    count = 7 * sum(len(level.rest) for level in run.levels)
    monkeypatch.setattr("pdvol.studio.play.panes.MOST_VERTEX_STATES", count // 3)
    assert [list(pane.steps) for pane in thinned(panes)] == [[0, 4, 6]] * 2
    nothing = Pane("a", note="it failed")
    assert thinned([nothing, *panes], 2)[0] is nothing and nothing.steps == []


def test_an_unfinished_level_says_how_far_it_goes(small_run):
    runs.keep_states(small_run / "levels" / "1", 3)
    first, second = panes_of_run(open_run(small_run))
    assert first.note == "" and second.states == 3 and second.note == "stored up to 0.04 s of 0.12 s"
    runs.keep_states(small_run / "levels" / "1", 0)
    assert [pane.level for pane in panes_of_run(open_run(small_run))] == [0]
    with pytest.raises(InputError, match="level 1 has no stored state to play"):
        panes_of_run(open_run(small_run), [1])


def test_what_cannot_be_played_is_named(flat_run, solid_run, tmp_path):
    flat, solid = (panes_of_run(open_run(run)) for run in (flat_run, solid_run))
    for panes, said in (([*flat, *solid], "2D and in 3D"), ([Pane("3", note="it failed")], "no stored state")):
        with pytest.raises(InputError, match=said):
            player_page(panes)
    for text in ("{}", '{"variations": []}', '{"variations": 3}', '{"variations": [3]}', "[", "[]"):
        (tmp_path / "wedge.json").write_text(text)
        with pytest.raises(InputError, match="wedge.json"):
            panes_of_wedge(tmp_path)


def test_a_wedge_folder_with_gaps(flat_run, tmp_path):
    shutil.copytree(flat_run, tmp_path / "runs" / "a")
    entries = [
        {"number": 7, "name": "a", "changes": {"spin": "2"}, "scores": {"quiet": 0.5, "meets": None}, "reason": ""},
        {"name": "b", "state": "waiting"},
        {"number": 9, "name": "c", "changes": {"spin": "4"}, "reason": "no convergence", "scores": None}
        | {"state": "failed"},
        {},
    ]
    (tmp_path / "wedge.json").write_text(json.dumps({"variations": entries}))
    panes = panes_of_wedge(tmp_path)
    assert [pane.title for pane in panes] == ["7", "b", "9", "3"]
    assert list(panes[0].lines) == ["spin=2", "quiet 0.5"] and panes[0].level == 0 and panes[0].states == 7
    assert [pane.note for pane in panes[1:3]] == ["not simulated yet", "no convergence"] and panes[3].note
    assert [pane.title for pane in panes_of_wedge(tmp_path, [0, 1])][:2] == ["7, level 0", "7, level 1"]
    assert "no convergence" in player_page(panes)
    values = {"3": 0.2, "5": None, "7": 0.9, "9": -1.0}
    entries = [{"number": n, "name": n, "changes": {"a": n}, "scores": {"s": v}} for n, v in values.items()]
    (tmp_path / "wedge.json").write_text(json.dumps({"variations": [*entries, {"name": "waits"}]}))
    assert [pane.title for pane in panes_of_wedge(tmp_path)] == ["7", "3", "9", "5", "waits"], "the best comes first"
