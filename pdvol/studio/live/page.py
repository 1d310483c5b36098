"""The live page: what its browsers are sent, and what they may ask for, over a `Session`. One of them has the hand."""

import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection

from pdvol.errors import InputError, PdvolError
from pdvol.runs.scene_file import parse_value
from pdvol.runs.stage_lines import real_time
from pdvol.scene import Support
from pdvol.store.files import jsonable
from pdvol.studio.live.controls import Control
from pdvol.studio.live.frames import Frames, whole_view
from pdvol.studio.live.live_run import LiveRun
from pdvol.studio.live.session import Session
from pdvol.studio.play.document import COLOURS, camera_entry, player_page, rendered
from pdvol.studio.play.panes import Pane, panes_of_run, thinned
from pdvol.studio.shown import upward
from pdvol.studio.wedge.variation import short_text, value_text

PERIOD = 0.02  # seconds between looks at the stored states
PLAYED_PERIOD = 0.005  # seconds between them while a hand waits for what it does
STILL_PERIOD = 0.1  # seconds between looks at all else, while a hand waits for a step
FACTOR_STEPS = 100  # last steps of level 0 whose real-time factor is shown
FACTOR_EVERY = 0.5  # seconds between looks at it
TYPING_PAUSE = 0.7  # seconds after the last key in a text field
MOST_STATES = 64  # that a page may ask for at once
LIVE_SCRIPTS = ("states.js", "shaders.js", "bodies.js", "view.js", "hand.js", "live.js")


class Page:
    """One page over a session. Each browser that shows it has its own moment, level and view.

    Parameters
    ----------
    session : its runs
    controls : for the scene's parameters
    levels : the number of levels that may come
    title : of the scene
    movable : as of `Frames`

    """

    def __init__(
        self,
        session: Session,
        controls: Sequence[Control],
        levels: int,
        title: str,
        movable: Mapping[str, Support | None] = MappingProxyType({}),
    ):
        self._session, self._title, self._levels, self._movable = session, title, levels, movable
        self._factor, self._factor_at = 0.0, 0.0
        self._looked_at, self._looked = 0, 0.0  # step and time of the last look
        self._owner: ServerConnection | None = None  # the browser that has the hand
        self._controls = {control.name: control for control in controls}
        self._frames: dict[int, Frames] = {}  # by level, of one run
        self._frames_of = 0
        self._lock = threading.Lock()
        self._news = threading.Condition()
        self._status: dict[str, Any] = {}
        self._end = threading.Event()
        self._work: dict[str, Callable[..., Any]] = {
            "play": self._play,
            "hand": self._hand,
            "scene": self._scene,
            "states": self._states,
            "change": self._change,
            "fit": self._fit,
            "reset": lambda: session.change({control.name: control.value for control in controls}),
            "branch": lambda step: session.branch(int(step)),
            "end_take": lambda: session.end_take(),
            "show": lambda number: session.show(number),
            "refine": lambda number: session.refine(number),
            "go_to": lambda step: session.go_to(int(step)),
            "pause": lambda: session.pause(),
            "resume": lambda: session.resume(),
            "keep": lambda name: {"folder": str(session.keep(str(name)))},
        }

    def html(self, path: str) -> str | None:
        """What a browser loads: the page, or the takes beside each other; None where there is nothing."""
        if path == "/takes":
            return player_page(self._takes_beside_each_other(), f"{self._title}: takes")
        if path != "/":
            return None
        controls = [asdict(control) | {"text": control.text} for control in self._controls.values()]
        data = jsonable({"colours": COLOURS, "controls": controls, "name": f"{self._title}_1"})
        return rendered(
            "live.html.jinja", LIVE_SCRIPTS, title=f"pdvol live: {self._title}", data=data, levels=self._levels
        )

    def serve(self) -> None:
        """Keep the page going until `stop`."""
        while not self._end.is_set():
            self.update()
            self._end.wait(PLAYED_PERIOD if self._session.playing else PERIOD)

    def stop(self) -> None:
        """End `serve` and the conversations."""
        self._end.set()
        with self._news:
            self._news.notify_all()

    def update(self) -> None:
        """Follow the session once."""
        self._session.tick()
        playing, now = self._session.playing, time.monotonic()
        steps = 0 if playing is None else playing.steps
        if steps and steps == self._looked_at and now < self._looked + STILL_PERIOD:
            return
        self._looked_at, self._looked = steps, now
        status = self._look()
        if status != self._status:
            with self._news:
                self._status = status
                self._news.notify_all()

    def talk(self, browser: ServerConnection) -> None:
        """Answer one browser, and send it the status whenever that has changed, until one of both ends. Its hand lets
        go when it ends.
        """
        sender = threading.Thread(target=self._report, args=(browser,), daemon=True)
        sender.start()
        try:
            for message in browser:
                for answer in self.answers(message, browser):
                    browser.send(answer)
        except ConnectionClosed:
            pass
        finally:
            self._let_go(browser)

    def _report(self, browser: ServerConnection) -> None:
        """Send a browser the status whenever that has changed, and the newest state of a take that is played."""
        sent = None
        with suppress(ConnectionClosed):
            while not self._end.is_set():
                seen = self._status
                status = seen and seen | {"mine": self._owner is browser}
                if status and status != sent:
                    browser.send(json.dumps({"status": status}))
                    sent = status
                    if status.get("factor") is not None:
                        with suppress(PdvolError):
                            for state in self._states(status["run"], 0, [status["states"][0] - 1]):
                                browser.send(state)
                with self._news:
                    if self._status is seen:
                        self._news.wait(PERIOD)
        browser.close()

    def answers(self, message: str | bytes, browser: Any = None) -> Iterator[str | bytes]:
        """What a browser gets for a message: a mistake is one line, whatever it sends."""
        try:
            request = json.loads(message)
            name = request.pop("do")
            if name in ("hand", "play"):
                request["browser"] = browser
            found = self._work[name](**request)
        except PdvolError as error:
            yield json.dumps({"message": " ".join(str(error).split())})
        except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError):
            yield json.dumps({"message": "the page has sent something else than a command; load it again"})
        else:
            yield from found if isinstance(found, list) else [json.dumps({"done": name, **(found or {})})]

    # ---- what a browser may ask for

    def _scene(self, run: int, level: int) -> dict | list:
        frames = self._of(run, level)
        return {"run": run, "level": level, **frames.scene()} if frames else []

    def _states(self, run: int, level: int, steps: list[int]) -> list[bytes]:
        frames = self._of(run, level)
        wanted = [int(step) for step in steps[:MOST_STATES]]
        shown = [] if frames is None else [step for step in wanted if 0 <= step < frames.level.steps]
        samples = ((self._line(self._session.playing, step) or {}).get("sample", 0) for step in shown)
        heads = (np.array([run, level, *each], "<i4").tobytes() for each in zip(shown, samples, strict=True))
        return [head + frames.places(step) for head, step in zip(heads, shown, strict=True) if frames]

    def _change(self, name: str, value: Any) -> None:
        if not isinstance(value, str | int | float):
            raise TypeError(f"{name} is a number or text")
        wait = {"wait": TYPING_PAUSE} if self._controls[name].kind == "text" else {}
        self._session.change({name: parse_value(value) if isinstance(value, str) else value}, **wait)

    def _play(self, step: int, browser: Any) -> None:
        """Begin a take by this browser's hand, from a step of what is shown."""
        self._owner = browser
        self._session.branch(int(step), by_hand=True)

    def _hand(self, pulls: list, obstacles: dict, sample: int, browser: Any) -> list:
        """What a browser's hand does now; the hand goes to the first one that asks where none has it."""
        playing = self._session.playing
        if playing is None or playing.hand is None:
            raise InputError("no take is played; choose Play by hand")
        if self._owner not in (None, browser):
            raise InputError("another page has the hand")
        if strange := [name for name in obstacles if name not in self._movable]:
            raise InputError(f"{strange[0]} is not marked as movable in the scene")
        self._owner = browser
        playing.hand.hold(pulls, obstacles, sample)
        return []

    def _let_go(self, browser: ServerConnection) -> None:
        if self._owner is browser:
            self._owner = None
            playing = self._session.playing
            if playing is not None and playing.hand is not None:
                playing.hand.hold([], {})

    def _line(self, run: LiveRun | None, step: int) -> dict | None:
        """What the hand of a take did in a step."""
        stored = None if run is None or run.hand is None else run.stored
        return None if stored is None or stored.hand is None else stored.hand.line(step)

    def _takes_beside_each_other(self) -> list[Pane]:
        panes = []
        for number, take in enumerate(self._session.takes, 1):
            stored = take.stored
            if stored is not None and take.steps:
                level = max(0, take.levels_with(take.steps - 1) - 1)
                panes += [replace(pane, title=_name(take, number)) for pane in panes_of_run(stored, [level])]
        return thinned(panes)

    def _fit(self) -> dict:
        stored = self._session.shown and self._session.shown.stored
        if not stored:
            raise InputError("there is nothing to see yet")
        return {"camera": jsonable(camera_entry(whole_view(stored), upward(stored)))}

    def _of(self, run: int, level: int) -> Frames | None:
        """The frames of a level of the run that is shown; None where that is another one."""
        with self._lock:
            shown = self._session.shown
            if shown is None or shown.stored is None or shown.number != run:
                return None
            if self._frames_of != run:
                self._frames_of, self._frames = run, {}
            if level not in self._frames and 0 <= level < len(shown.stored.levels):
                self._frames[level] = Frames(shown.stored, level, self._movable)
            return self._frames.get(level)

    # ---- what all browsers are sent

    def _look(self) -> dict[str, Any]:
        """What the page says and shows, in JSON's types."""
        session, run = self._session, self._session.current
        values = {name: session.values.get(name, one.value) for name, one in self._controls.items()}
        texts = {name for name, one in self._controls.items() if one.kind in ("text", "choice")}
        found: dict[str, Any] = {
            "lines": [["faint", "starting ..."]] if run is None else self._lines(run),
            "paused": session.paused,
            "values": {name: value_text(value) if name in texts else value for name, value in values.items()},
        }
        shown = session.shown
        if shown is not None and shown.stored is not None:
            stored = shown.stored
            found |= {"run": shown.number, "begin": shown.branch[1] if shown.branch else 0, "dt": stored.dt}
            found |= {"states": [level.steps for level in stored.levels], "steps": stored.info["steps"]}
            found |= {"ended": shown.level_0_ended}
        found |= {"takes": [], "playing": session.playing is not None, "free": self._owner is None}
        for number, take in enumerate(session.takes, 1):
            if take.steps and take.stored is not None:
                seconds, levels = (take.steps - 1) * take.stored.dt, take.levels_with(take.steps - 1)
                words = f"{seconds:.2f} s" + (f", levels 0 to {levels - 1}" if levels > 1 else "")
                found["takes"].append({"number": take.number, "name": _name(take, number), "words": words})
        if session.playing is not None and shown is session.playing:
            line = self._line(shown, shown.steps - 1)
            found |= {"factor": self._real_time(shown), "offsets": {} if line is None else line["obstacles"]}
        return jsonable(found)

    def _real_time(self, run: LiveRun) -> float:
        """Of the last steps of level 0 [s of the shot a s of computing], looked at now and then."""
        now = time.monotonic()
        if run.stored is not None and now > self._factor_at + FACTOR_EVERY:
            self._factor_at, records = now, run.stored.levels[0].log[-FACTOR_STEPS:]
            spent = sum(record["seconds"]["total"] for record in records)
            self._factor = run.stored.dt * len(records) / max(spent, 1e-9) if records else 0.0
        return round(self._factor, 1)

    def _lines(self, run: LiveRun) -> list[list[str]]:
        """A class and a line each."""
        shown = self._session.shown
        state = "paused" if self._session.paused and run.running else run.state
        values = ", ".join(f"{name} {short_text(value_text(value))}" for name, value in sorted(run.values.items()))
        lines = [["title", f"run {run.number}"], ["", values], *(["", line] for line in _level_lines(run))]
        lines += [["", state if run.first_state is None else f"{state}, first state after {run.first_state:.2f} s"]]
        lines += [["faint", run.lasting], ["faint", run.note], ["wrong", run.remark], ["wrong", run.reason]]
        if shown is not None:
            lines += [["faint", f"on the screen: run {shown.number}" if shown is not run else ""]]
            lines += [["faint", f"kept in {shown.kept}" if shown.kept else ""]]
        return [line for line in lines if line[1]]


def _name(take: LiveRun, number: int) -> str:
    return take.kept.name if take.kept else f"take {number}"


def _level_lines(run: LiveRun) -> list[str]:
    stored = run.stored
    if stored is None:
        return []
    lines, total = [], stored.info["steps"]
    for level in stored.levels:
        line = f"level {level.index}: {max(0, level.steps - 1)} of {total} steps, {level.info['vertices']:,} vertices"
        if level.steps > total:
            spent = sum(record["seconds"]["total"] for record in level.log)
            line += f", {real_time(stored.dt * len(level.log), spent)}"
        lines.append(line)
    return lines
