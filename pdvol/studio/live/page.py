"""The live page: what its browsers are sent, and what they may ask for, over a `Session`."""

import json
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection

from pdvol.errors import InputError, PdvolError
from pdvol.runs.scene_file import parse_value
from pdvol.runs.stage_lines import real_time
from pdvol.store.files import jsonable
from pdvol.studio.live.controls import Control
from pdvol.studio.live.frames import Frames, whole_view
from pdvol.studio.live.live_run import LiveRun
from pdvol.studio.live.session import Session
from pdvol.studio.play.document import COLOURS, camera_entry, rendered
from pdvol.studio.shown import upward
from pdvol.studio.wedge.variation import short_text, value_text

PERIOD = 0.01  # seconds between looks at the stored states, and at what a page asks for
TYPING_PAUSE = 0.7  # seconds after the last key in a text field
MOST_STATES = 64  # that a page may ask for at once
LIVE_SCRIPTS = ("states.js", "shaders.js", "bodies.js", "view.js", "live.js")


class Page:
    """One page over a session. Each browser that shows it has its own moment, level and view.

    Parameters
    ----------
    session : its runs
    controls : for the scene's parameters
    levels : the number of levels that may come
    title : of the scene
    """

    def __init__(self, session: Session, controls: Sequence[Control], levels: int, title: str):
        self._session, self._title, self._levels = session, title, levels
        self._controls = {control.name: control for control in controls}
        self._frames: dict[int, Frames] = {}  # by level, of one run
        self._frames_of = 0
        self._lock = threading.Lock()
        self._status: dict[str, Any] = {}
        self._end = threading.Event()
        self._work: dict[str, Callable[..., Any]] = {
            "scene": self._scene,
            "states": self._states,
            "change": self._change,
            "fit": self._fit,
            "reset": lambda: session.change({control.name: control.value for control in controls}),
            "branch": lambda step: session.branch(int(step)),
            "go_to": lambda step: session.go_to(int(step)),
            "pause": lambda: session.pause(),
            "resume": lambda: session.resume(),
            "keep": lambda name: {"folder": str(session.keep(str(name)))},
        }

    def html(self) -> str:
        """The page as a browser loads it."""
        controls = [asdict(control) | {"text": control.text} for control in self._controls.values()]
        data = jsonable({"colours": COLOURS, "controls": controls, "name": f"{self._title}_1"})
        return rendered(
            "live.html.jinja", LIVE_SCRIPTS, title=f"pdvol live: {self._title}", data=data, levels=self._levels
        )

    def serve(self) -> None:
        """Keep the page going until `stop`."""
        while not self._end.is_set():
            self.update()
            self._end.wait(PERIOD)

    def stop(self) -> None:
        """End `serve` and the conversations."""
        self._end.set()

    def update(self) -> None:
        """Follow the session once."""
        self._session.tick()
        self._status = self._look()

    def talk(self, browser: ServerConnection) -> None:
        """Answer one browser, and send it the status whenever that has changed, until one of both ends."""
        sent = None
        with suppress(ConnectionClosed):
            while not self._end.is_set():
                with suppress(TimeoutError):
                    for answer in self.answers(browser.recv(timeout=PERIOD)):
                        browser.send(answer)
                status = self._status
                if status and status != sent:
                    browser.send(json.dumps({"status": status}))
                    sent = status

    def answers(self, message: str | bytes) -> Iterator[str | bytes]:
        """What a browser gets for a message: a mistake is one line, whatever it sends."""
        try:
            request = json.loads(message)
            name = request.pop("do")
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
        heads = (np.array([run, level, step, 0], "<i4").tobytes() for step in shown)
        return [head + frames.places(step) for head, step in zip(heads, shown, strict=True) if frames]

    def _change(self, name: str, value: Any) -> None:
        if not isinstance(value, str | int | float):
            raise TypeError(f"{name} is a number or text")
        wait = {"wait": TYPING_PAUSE} if self._controls[name].kind == "text" else {}
        self._session.change({name: parse_value(value) if isinstance(value, str) else value}, **wait)

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
                self._frames[level] = Frames(shown.stored, level)
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
        return jsonable(found)

    def _lines(self, run: LiveRun) -> list[list[str]]:
        """A class and a line each."""
        shown = self._session.shown
        state = "paused" if self._session.paused and run.running else run.state
        values = ", ".join(f"{name} {short_text(value_text(value))}" for name, value in sorted(run.values.items()))
        lines = [["title", f"run {run.number}"], ["", values], *(["", line] for line in _level_lines(run))]
        lines += [["", state if run.first_state is None else f"{state}, first state after {run.first_state:.2f} s"]]
        lines += [["faint", run.lasting], ["faint", run.note], ["wrong", run.reason]]
        if shown is not None:
            lines += [["faint", f"on the screen: run {shown.number}" if shown is not run else ""]]
            lines += [["faint", f"kept in {shown.kept}" if shown.kept else ""]]
        return [line for line in lines if line[1]]


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
