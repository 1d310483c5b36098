"""The live page by hand: its real-time factor, and the time from an event of the mouse to the first picture after it.

    PDVOL_BROWSER=1 ./run python -m benchmarks.live [bunny,drop_500] [--seconds 4]

A mouse drags the first body, and each take is then replayed without a page. The table is kept by NOTES.md beside this.
"""

import math
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import mean, quantiles

from benchmarks.common.process import REPOSITORY, Mistake, machine
from benchmarks.common.rows import ROWS, chosen
from benchmarks.common.study import command
from benchmarks.common.tables import Kept, Page, number
from pdvol.store.reader import open_run

SCENES = {"ball_on_spike": "`ball_on_spike`", "bunny": "README's bunny", "drop_500": "`drop_500`"}
WINDOW, PAUSE = (1100, 720), 0.012  # pixels of the page, and seconds between two movements of the mouse
PLAYS = "live.run > 1 && live.status.states[0] > 3 && [...live.levels.values()].includes(live.shown) && live.follows"
MIDDLE = """(() => {
  const { rows } = live.shown.touchable()[0], n = rows.length / 4, box = stage.getBoundingClientRect();
  const mean = [0, 1, 2].map((k) => rows.reduce((sum, value, i) => (i % 4 === k ? sum + value / n : sum), 0));
  const { x, y } = new THREE.Vector3(...mean).project(live.view.camera);
  return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height];
})()"""
HEAD = "scene|vertices|steps|Newton|CPU time a step [ms]|real-time factor|without a page|hand to picture [ms]|90 %|load"


@command(
    "live",
    __doc__,
    {
        "scenes": {"nargs": "?", "default": "", "help": f"of {', '.join(SCENES)} (default: all)"},
        "--seconds": {"type": float, "default": 4.0, "help": "how long the mouse drags (default: 4)"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "live", "help": "for live.json, the records"},
        "--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where the table is kept"},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    names = chosen(options.scenes, SCENES)
    sys.path.append(str(REPOSITORY / "tests" / "helpers"))
    try:
        from browser import CHROMIUM
    except ModuleNotFoundError as error:
        raise Mistake(f"{error}; pip install '.[test,live]'") from None
    if not any(map(shutil.which, CHROMIUM)):
        raise Mistake("there is no Chromium in PATH; PDVOL_BROWSER=1 ./run has one")
    kept = Kept(options.out / "live.json", SCENES, HEAD.split("|"), cells, Page(options.docs, "live", "table"))
    kept.run(names, lambda name: played(name, options.seconds))


def played(name: str, seconds: float) -> dict:
    """What a take by the mouse gives."""
    from browser import chromium
    from live_page import Live

    with tempfile.TemporaryDirectory(prefix="pdvol-live-") as made:
        folder, words = Path(made), ["--set", f"name={name}"] if name in ROWS else []
        file, load = REPOSITORY / (ROWS[name].file if name in ROWS else f"demos/{name}.py"), machine()["load"]
        if name == "bunny":
            file = folder / "bunny.py"
            file.write_text(re.findall(r"```python\n(.*?)```", (REPOSITORY / "README.md").read_text(), re.DOTALL)[0])
        with ExitStack() as stack:
            stack.callback((live := Live(folder, file, *words)).end)
            first, delays = dragged(stack.enter_context(chromium(*WINDOW)).open(live.address), seconds)
        take, again = folder / "kept" / "take", folder / "again"
        record = ["--hand", take / "hand.jsonl", "--levels", "0:0", "--no-picture", "--no-xdmf", "--out", again]
        subprocess.run([sys.executable, "-m", "pdvol", "run", file, *words, *record], check=True, capture_output=True)
        run = open_run(take)
        log, alone = (each.levels[0].log[first:] for each in (run, open_run(again)))
        factors = [run.dt / mean(each["seconds"]["total"] for each in steps) for steps in (log, alone)]
        iterations, cpu = mean(r["newton_iterations"] for r in log), 1e3 * mean(r["seconds"]["cpu"] for r in log)
        sizes = {"vertices": run.levels[0].info["vertices"], "steps": len(log), "newton": iterations, "cpu": cpu}
        return {**sizes, "factors": factors, "delays": quantiles(delays, n=10)[4::4], "load": load}


def dragged(tab, seconds: float) -> tuple[int, list[float]]:
    """Plays a take and keeps it as `take`; its first step under the mouse, and delays [ms]."""
    page = tab.page
    tab.until("window.live && live.shown")
    page.evaluate("live.choose(0)")
    page.get_by_role("button", name="Play by hand").click()
    tab.until(PLAYS)
    x, y = page.evaluate(MIDDLE)
    page.mouse.move(x, y)
    page.mouse.down()
    first, begin = page.evaluate("live.newest"), time.monotonic()
    while (passed := time.monotonic() - begin) < seconds:
        wide = min(1.0, passed)
        page.mouse.move(x + 90 * wide * math.sin(2 * passed), y - wide * (60 + 40 * math.sin(3.1 * passed)))
        time.sleep(PAUSE)
    page.mouse.up()
    page.get_by_role("button", name="End the take").click()
    tab.until("!live.status.playing")
    page.evaluate("live.ask('keep', { name: 'take' })")
    tab.until("document.body.innerText.includes('kept in')")
    return first, page.evaluate("live.hand.delays")


def cells(name: str, record: dict) -> list[list[str]]:
    """The cells of a row."""
    numbers = [number(value, 2) for value in (record["newton"], record["cpu"], *record["factors"])]
    more = [*(f"{delay:.0f}" for delay in record["delays"]), f"{record['load']:.1f}"]
    return [[SCENES[name], str(record["vertices"]), str(record["steps"]), *numbers, *more]]


if __name__ == "__main__":
    sys.exit(main())
