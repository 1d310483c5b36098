"""What the live page answers a browser, without a browser."""

import json
from types import SimpleNamespace

import pytest

from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.live.controls import Control

pytest.importorskip("websockets", reason="the live page needs websockets (extra `live`)")
from pdvol.studio.live.channel import Channel
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
    page = Page(
        session,
        [Control("young", "slider", 1.0, 0.5, 2.0, 0.1), Control("label", "text", "x")],
        2,
        "test",
        {"door": None},
    )

    def ask(message):
        text = message if isinstance(message, str | bytes) else json.dumps(message)
        return [one if isinstance(one, bytes) else json.loads(one) for one in page.answers(text)]

    ask.changes, ask.stored, ask.page, ask.session, ask.run = changes, stored, page, session, run
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


HELD = {"number": 1, "body": "a", "place": [0.0, 0.0, 0.0], "point": [1.0, 0.0, 0.0]}


def hand_of(asked, tmp_path):
    """The hand of a take that the page shows as played."""
    asked.run.hand = Channel(tmp_path / "1.hand")
    asked.session.playing = asked.run
    return asked.run.hand.file


def hand_message(pulls="[]", obstacles="{}", sample="1"):
    return f'{{"do": "hand", "pulls": {pulls}, "obstacles": {obstacles}, "sample": {sample}}}'


def test_a_hand_holds_what_it_is_asked_to_and_needs_a_take(asked, tmp_path):
    assert asked(hand_message())[0]["message"].startswith("no take is played")
    channel = hand_of(asked, tmp_path)
    assert asked(hand_message(json.dumps([HELD]))) == [], "what comes often needs no answer"
    assert json.loads(channel.read_text()) == {"pulls": [HELD], "obstacles": {}, "sample": 1}


NO_COMMANDS = [
    "", "{", "[]", "3", b"\xff\x00", "{}", {"do": 3}, {"do": "__init__"}, {"do": "scene"},
    {"do": "scene", "run": 3, "level": [0]}, {"do": "states", "run": 3, "level": 0, "steps": 5},
    {"do": "states", "run": 3, "level": 0, "steps": ["a"]}, {"do": "states", "run": 3, "level": 0, "steps": [None]},
    '{"do": "states", "run": 3, "level": 0, "steps": [1e999]}', {"do": "change", "name": "colour", "value": 1},
    {"do": "change", "name": "young", "value": [1]}, {"do": "change", "name": "young", "value": 1, "more": 2},
    "[" * 60_000,
]  # fmt: skip
NO_HANDS = [
    hand_message('[{"number": 1, "body": "a", "place": [NaN, 0, 0], "point": [0, 0, 0]}]'),
    hand_message('[{"number": 1, "body": "a", "place": [0, 0, 0], "point": [1e999, 0, 0]}]'),
    hand_message('[{"number": 1, "body": "a", "place": [0, 0, 0], "point": "here"}]'),
    hand_message('[{"number": 1, "body": "a"}]'),
    hand_message('[{"number": 1, "body": "a", "place": [0], "point": [0, 0, 0]}]'),
    hand_message('[{"number": 1e999, "body": "a", "place": [0, 0, 0], "point": [0, 0, 0]}]'),
    hand_message(json.dumps([HELD] * 1000)),
    hand_message("3"),
    hand_message("[3]"),
    hand_message("[]", '{"door": [NaN, 0, 0]}'),
    hand_message("[]", '{"wall": [0, 0, 0]}'),
    hand_message("[]", "[3]"),
    hand_message(sample='"x"'),
    {"do": "keep", "name": "a"},
]


@pytest.mark.parametrize("message", [*NO_COMMANDS, *NO_HANDS])
def test_a_mistake_is_one_line_and_changes_nothing(asked, tmp_path, message):
    channel = hand_of(asked, tmp_path)
    asked(hand_message(json.dumps([HELD])))
    before = channel.read_text()
    (answer,) = asked(message)
    assert answer["message"] and "\n" not in answer["message"]
    assert answer["message"].startswith(WRONG) or message in NO_HANDS
    assert channel.read_text() == before and asked.changes == []


def test_a_burst_of_a_hand_ends_with_the_last_point(asked, tmp_path):
    channel = hand_of(asked, tmp_path)
    for i in range(1000):
        asked(hand_message(json.dumps([HELD | {"point": [float(i), 0.0, 0.0]}]), sample=str(i + 1)))
    assert json.loads(channel.read_text())["pulls"][0]["point"][0] == 999.0
    assert json.loads(channel.read_text())["sample"] == 1000
