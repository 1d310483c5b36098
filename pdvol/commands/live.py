"""`pdvol live`: a local page on which level 0 of a scene runs while one looks."""

import shutil
import signal
import sys
import tempfile
import threading
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from pdvol.commands.options import SHOT, add, add_repeated, chosen_shot, level_range
from pdvol.errors import InputError

PORT = 8080
FINEST_BY_DEFAULT = 1  # level: it follows the preview within seconds


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol live`."""
    add(parser, *SHOT)
    add_repeated(parser, "--vary", "NAME=A:B", "the range of a parameter's slider, or NAME=A,B,C for a choice")
    add(parser, "--levels")
    parser.add_argument("--wavefront", action="store_true", help="run the finer levels side by side, a process each")
    parser.add_argument("-o", "--out", type=Path, default=Path("runs"), help="folder for kept runs (default: runs)")
    parser.add_argument("--port", type=int, default=PORT, help=f"of the page (default: {PORT}, or the next free one)")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine only)")


def main(options: Namespace) -> None:
    """Serve the page until Ctrl-C; processes and temporary runs end with it."""
    from pdvol.stages import stage

    shot = chosen_shot(options)
    first, last = level_range(options.levels or f"0:{min(FINEST_BY_DEFAULT, shot.scene.levels - 1)}")
    last = shot.scene.levels - 1 if last is None else last
    if first != 0 or last >= shot.scene.levels:
        raise InputError(f"--levels {options.levels}: write 0:L; the scene has levels 0:{shot.scene.levels - 1}")
    if not 0 <= options.port < 65536:
        raise InputError(f"--port {options.port} is no port; write a number below 65536")
    try:
        with stage("loading the page"):
            from pdvol.runs.scene_file import parse_settings
            from pdvol.studio.live.controls import controls
            from pdvol.studio.live.page import Page
            from pdvol.studio.live.server import LocalServer
            from pdvol.studio.live.session import Session
    except ModuleNotFoundError as error:
        if error.name != "websockets":
            raise
        raise InputError("the live page needs websockets: pip install 'websockets<17'") from None
    settings = parse_settings(options.set)
    shown = controls(options.scene, settings, options.vary)
    folder = Path(tempfile.mkdtemp(prefix="pdvol-live-"))
    session = page = server = None
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        session = Session(
            options.scene.resolve(), settings, folder, options.out, last, options.steps, options.wavefront
        )
        movable: dict[str, Any] = {one.name: None for one in shot.scene.obstacles if getattr(one, "movable", False)}
        movable |= {f"support {number}": one for number, one in enumerate(shot.scene.supports) if one.movable}
        page = Page(session, shown, last + 1, shot.name, movable)
        server = LocalServer(options.host, options.port, page.html, page.talk)
        # A signal ends the loop between two updates. An exception in the middle of one can get lost in a library. A
        # thread takes the locks, for the one that is interrupted may hold them.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: threading.Thread(target=page.stop).start())
        session.start()
        print(f"{server.address} shows {options.scene}; Ctrl-C ends it", file=sys.stderr, flush=True)
        page.serve()
        print("ended" + f"; kept runs are in {options.out}" * any(options.out.glob("*")), file=sys.stderr)
    except KeyboardInterrupt:
        print("ended", file=sys.stderr)
    finally:
        if page is not None:
            page.stop()
        if session is not None:
            session.close()
        if server is not None:
            server.stop()
        shutil.rmtree(folder, ignore_errors=True)
