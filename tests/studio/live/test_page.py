"""What the live page answers a browser, without a browser."""

import json
from types import SimpleNamespace

import pytest

from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.live.controls import Control

pytest.importorskip("websockets", reason="the live page needs websockets (extra `live`)")
from pdvol.studio.live.page import MOST_STATES, Page

WRONG = "the page has sent something else than a command"


@pytest.fixture
def asked(solid_run):
    """Sends a message to a page over a made-up session; `changes` are what the session was asked for."""
    stored, changes = open_run(solid_run), []
    run = SimpleNamespace(number=3, stored=stored)

    def keep(name):
        raise InputError(f"{name!r}\nis taken")

    session = SimpleNamespace(
        shown=run, change=lambda values, **wait: changes.append((values, wait)), keep=keep, playing=None
    )
    page = Page(session, [Control("young", "slider", 1.0, 0.5, 2.0, 0.1), Control("label", "text", "x")], 2, "test")

    def ask(message):
        text = message if isinstance(message, str | bytes) else json.dumps(message)
        return [one if isinstance(one, bytes) else json.loads(one) for one in page.answers(text)]

    ask.changes, ask.stored = changes, stored
    return ask


def test_states_are_those_that_are_stored_of_the_run_that_is_shown(asked):
    steps = asked.stored.levels[0].steps
    many = asked({"do": "states", "run": 3, "level": 0, "steps": [0, -1, steps - 1, steps, 10**9]})
    assert [int.from_bytes(state[8:12], "little") for state in many] == [0, steps - 1]
    assert asked({"do": "states", "run": 2, "level": 0, "steps": [0]}) == []
    assert asked({"do": "states", "run": 3, "level": 9, "steps": [0]}) == []
    assert len(asked({"do": "states", "run": 3, "level": 0, "steps": [0] * 1000})) == MOST_STATES
    (scene,) = asked({"do": "scene", "run": 3, "level": 1})
    assert scene["done"] == "scene" and scene["level"] == 1 and scene["camera"]["dim"] == 3


def test_values_are_changed_by_name_and_texts_wait_for_the_next_key(asked):
    asked({"do": "change", "name": "young", "value": 1.25})
    asked({"do": "change", "name": "label", "value": "(1, 2)"})
    (young, wait), (label, longer) = asked.changes
    assert (young, wait, label) == ({"young": 1.25}, {}, {"label": (1, 2)}) and longer["wait"] > 0.0


@pytest.mark.parametrize(
    "message",
    [
        "", "{", "[]", "3", b"\xff\x00", "{}", {"do": 3}, {"do": "__init__"}, {"do": "scene"},
        {"do": "scene", "run": 3, "level": [0]}, {"do": "states", "run": 3, "level": 0, "steps": 5},
        {"do": "states", "run": 3, "level": 0, "steps": ["a"]}, {"do": "states", "run": 3, "level": 0, "steps": [None]},
        '{"do": "states", "run": 3, "level": 0, "steps": [1e999]}', {"do": "change", "name": "colour", "value": 1},
        {"do": "change", "name": "young", "value": [1]}, {"do": "change", "name": "young", "value": 1, "more": 2},
        "[" * 60_000,
    ],
)  # fmt: skip
def test_what_is_no_command_is_one_line_and_changes_nothing(asked, message):
    (answer,) = asked(message)
    assert answer["message"].startswith(WRONG) and asked.changes == []


def test_a_mistake_is_one_line(asked):
    assert asked({"do": "keep", "name": "a"}) == [{"message": "'a' is taken"}]
