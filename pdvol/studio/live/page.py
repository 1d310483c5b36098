"""The live page: a viser scene with controls, over a `Session`."""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from pdvol.errors import PdvolError
from pdvol.runs.scene_file import parse_value
from pdvol.runs.stage_lines import real_time
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import Camera
from pdvol.studio.live.controls import Control
from pdvol.studio.live.frames import Frames, view, whole_view
from pdvol.studio.live.live_run import LiveRun
from pdvol.studio.live.playback import Playback
from pdvol.studio.live.server import LocalServer
from pdvol.studio.live.session import Session
from pdvol.studio.live.stage import Stage
from pdvol.studio.shown import upward_in_3d
from pdvol.studio.wedge.variation import short_text, value_text

PERIOD = 0.02  # seconds between looks at the stored states
TYPING_PAUSE = 0.7  # seconds after the last key in a text field
BUTTONS = ("first", "<", ">", "newest")
FINEST = "finest"
BUTTON_COLOUR = (107, 143, 199)  # red, green and blue


class Page:
    """One page over a session.

    Parameters
    ----------
    server : where it is shown
    session : its runs
    controls : for the scene's parameters
    levels : the number of levels that may come
    title : of the scene
    """

    def __init__(self, server: LocalServer, session: Session, controls: Sequence[Control], levels: int, title: str):
        self._server, self._session, self._controls = server, session, controls
        self._levels, self._title = levels, title
        self._stage, self._playback = Stage(server), Playback()
        self._lock = threading.RLock()
        self._frames: tuple[int, int, Frames] | None = None  # run, level
        self._run: int | None = None  # that is played
        self._drawn: tuple[int, int, int] | None = None  # run, level, step on the screen
        self._camera: Camera | None = None
        self._message = ""
        self._end = threading.Event()
        self._build()

    def serve(self) -> None:
        """Keep the page going until `stop`."""
        while not self._end.is_set():
            self.update()
            self._end.wait(PERIOD)

    def stop(self) -> None:
        """End `serve`."""
        self._end.set()

    def update(self) -> None:
        """Follow the session once."""
        self._session.tick()
        with self._lock:
            run = self._session.shown
            stored = None if run is None else run.stored
            if run is not None and stored is not None:
                self._draw(run, stored)
            self._set(self._status, "content", self._text())

    # ---- drawing

    def _draw(self, run: LiveRun, stored: Run) -> None:
        if self._run != run.number:
            self._run = run.number
            self._playback.restart()
            self._playback.step = run.branch[1] if run.branch else 0
        newest = run.steps - 1
        step = self._playback.advance(time.monotonic(), newest, run.level_0_ended, stored.dt)
        self._set(self._play, "label", "Stop" if self._playback.plays else "Play")
        wanted = None if self._level.value == FINEST else int(self._level.value)
        level = run.finest_with(step, wanted)
        if self._drawn == (run.number, level, step):
            return
        camera = self._camera or self._look(view(stored), stored)
        if self._frames is None or self._frames[:2] != (run.number, level):
            self._frames = run.number, level, Frames(stored, level, camera.size, camera.focus)
        self._stage.show(self._frames[2].at(step))
        self._drawn = run.number, level, step
        self._set(self._moment, "max", max(1, stored.info["steps"]))
        self._set(self._moment, "value", step)

    def _look(self, camera: Camera, stored: Run) -> Camera:
        """See a run from this camera; what is drawn has sizes that belong to it. Gives the camera."""
        self._camera, self._drawn, self._frames = camera, None, None
        self._stage.look_from(camera, upward_in_3d(stored))
        return camera

    def _text(self) -> str:
        run, shown = self._session.current, self._session.shown
        lines = []
        if run is None:
            lines.append("*starting ...*")
        else:
            lines.append(f"**run {run.number}** {_values(run)}")
            lines += [f"{line}" for line in _level_lines(run)]
            state = "paused" if self._session.paused and run.running else run.state
            lines.append(state if run.first_state is None else f"{state}, first state after {run.first_state:.2f} s")
            lines += [run.lasting] if run.lasting else []
            lines += [f"*{run.note}*"] if run.note else []
            lines += [f"⚠ **{run.reason}**"] if run.reason else []
            if shown is not None and shown is not run:
                lines.append(f"*on the screen: run {shown.number}*")
            if shown is not None and shown.kept is not None:
                lines.append(f"kept in `{shown.kept}`")
        if self._drawn is not None and shown is not None and shown.stored is not None:
            _, level, step = self._drawn
            lines.insert(0, f"step {step}, {step * shown.stored.dt:.2f} s, level {level}")
        return "\n\n".join([*lines, *([f"⚠ **{self._message}**"] if self._message else [])])

    # ---- controls

    def _build(self) -> None:
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BUTTON_COLOUR)
        gui.main_panel.dock_right()
        self._status = gui.add_markdown("*starting ...*")
        with gui.add_folder("Time"):
            self._moment = gui.add_slider("step", min=0, max=1, step=1, initial_value=0)
            self._play = gui.add_button("Play")
            self._one = gui.add_button_group("", BUTTONS)
            self._pause = gui.add_button("Pause computing", hint="hold the simulation; > computes the next step")
            names = (FINEST, *(str(level) for level in range(self._levels)))
            self._wireframe = gui.add_checkbox("wireframe", False, hint="the bodies' edges alone")
            self._level = gui.add_dropdown("level", names, hint="finest: of those that have reached the step")
        with gui.add_folder("Parameters"):
            self._fields = [(control, self._field(control)) for control in self._controls]
            again = gui.add_button("Go on from this step", hint="a new run: states up to this step, then these values")
            reset = gui.add_button("Reset values")
        with gui.add_folder("Keep"):
            name = gui.add_text("name", initial_value=f"{self._title}_1")
            keep = gui.add_button("Keep this run")
            fit = gui.add_button("Fit view", hint="see all that is stored so far")
        self._moment.on_update(self._scrub)
        self._play.on_click(lambda _: self._respond(self._play_or_stop))
        self._one.on_click(lambda event: self._respond(lambda: self._move(event.target.value)))
        self._pause.on_click(lambda _: self._respond(self._pause_or_go_on))
        self._wireframe.on_update(lambda event: self._respond(lambda: self._stage.draw_wireframe(event.target.value)))
        again.on_click(lambda _: self._respond(lambda: self._session.branch(self._playback.step)))
        reset.on_click(lambda _: self._respond(self._reset))
        keep.on_click(lambda _: self._respond(lambda: self._keep(name)))
        fit.on_click(lambda _: self._respond(self._fit))

    def _field(self, control: Control) -> Any:
        gui, name = self._server.gui, control.name
        field: Any
        if control.kind == "checkbox":
            field = gui.add_checkbox(name, bool(control.value))
        elif control.kind == "slider":
            field = gui.add_slider(name, control.low, control.high, control.step, control.value)
        elif control.kind == "choice":
            field = gui.add_dropdown(name, control.choices, initial_value=control.text)
        else:
            field = gui.add_text(name, control.text)
        wait = {"wait": TYPING_PAUSE} if control.kind == "text" else {}

        @field.on_update
        def _(event: Any) -> None:
            if event.client_id is not None:
                value = event.target.value
                values = {name: parse_value(value) if isinstance(value, str) else value}
                self._respond(lambda: self._session.change(values, **wait))

        return field

    def _respond(self, action: Callable[[], Any]) -> None:
        """Do what a control asks for; a mistake is shown."""
        with self._lock:
            self._message = ""
            try:
                action()
            except PdvolError as error:
                self._message = " ".join(str(error).split())

    def _scrub(self, event: Any) -> None:
        if event.client_id is not None:
            self._respond(lambda: self._playback.choose(int(event.target.value)))

    def _play_or_stop(self) -> None:
        run = self._session.shown
        if self._playback.plays:
            self._playback.choose(self._playback.step)
        elif run is not None:
            self._playback.play(time.monotonic(), run.steps - 1)

    def _move(self, button: str) -> None:
        run, step = self._session.shown, self._playback.step
        if run is None:
            return
        step = dict(zip(BUTTONS, (0, step - 1, step + 1, run.steps - 1), strict=True))[button]
        if step >= run.steps:
            self._session.go_to(step)
        self._playback.choose(step)
        self._playback.follows = button == BUTTONS[-1] and not run.level_0_ended

    def _pause_or_go_on(self) -> None:
        if self._session.paused:
            self._session.resume()
        else:
            self._session.pause()
        self._pause.label = "Go on computing" if self._session.paused else "Pause computing"

    def _reset(self) -> None:
        for control, field in self._fields:
            field.value = control.text if control.kind in ("text", "choice") else control.value
        self._session.change({control.name: control.value for control in self._controls})

    def _keep(self, name: Any) -> None:
        self._session.keep(name.value)
        stem, _, number = name.value.rpartition("_")
        name.value = f"{stem}_{int(number) + 1}" if stem and number.isdigit() else f"{name.value}_2"

    def _fit(self) -> None:
        stored = None if self._session.shown is None else self._session.shown.stored
        if stored is not None:
            self._look(whole_view(stored), stored)

    @staticmethod
    def _set(handle: Any, name: str, value: Any) -> None:
        """Set what has changed only: each assignment is a message."""
        if getattr(handle, name) != value:
            setattr(handle, name, value)


def _values(run: LiveRun) -> str:
    return ", ".join(f"{name} {short_text(value_text(value))}" for name, value in sorted(run.values.items()))


def _level_lines(run: LiveRun) -> list[str]:
    stored = run.stored
    if stored is None:
        return []
    total = stored.info["steps"]
    return [
        f"level {level.index}: {max(0, level.steps - 1)} of {total} steps, {level.info['vertices']:,} vertices"
        + (f", {_factor(stored, level)}" if level.steps > total else "")
        for level in stored.levels
    ]


def _factor(stored: Run, level: RunLevel) -> str:
    return real_time(stored.dt * len(level.log), sum(record["seconds"]["total"] for record in level.log))
