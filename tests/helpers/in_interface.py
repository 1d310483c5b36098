"""Scenarios of undo, of the panel and of installations, as those in in_extension.py; PDVOL_ZIP names the zip."""

import os
import shlex
import sys
import time
import zipfile
from pathlib import Path
from types import SimpleNamespace

import bpy

from extension_steps import SAFETY, begin, carry_out, cube, part, places, press, wait, world

# isort: split
from blender.addon import environment, hooks, operators, panel, tasks
from blender.shot.files import Places
from blender.work.session import Task
from blender.work.stored import stored_levels


def undo_takes_back_what_was_set(folder: Path) -> None:
    """Undo goes behind a button; runs are kept, and a preview that goes on is not disturbed."""
    scene = begin(folder, end=13)
    thing = cube("Box", cuts=1)
    bpy.ops.ed.undo_push(message="before")
    part("BODY", thing)
    bpy.ops.ed.undo_push(message="body")
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    bpy.data.objects["Box"].location.x = 3.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()  # while it runs: objects are others now
    scene, thing = bpy.context.scene, bpy.data.objects["Box"]
    assert thing.location.x == 0.0 and thing.pdvol.role == "BODY"
    assert wait() == ""
    scene.pdvol.run = 1  # undo went behind the button that set it
    assert world(thing, 13)[:, 2].mean() < 0.9
    bpy.ops.ed.undo()
    assert bpy.data.objects["Box"].pdvol.role == "NONE"
    assert press("preview").startswith("there is no soft body") and stored_levels(places().run(1)) == {0: 24}


def the_panel_draws_what_there_is_and_esc_ends_a_check(folder: Path) -> None:
    """Each of its states, with a layout that knows whether properties and buttons exist; bpy has no window. A check
    stands in the status bar and ends with Esc; other keys go on to Blender, and Esc too once the check has ended.
    """
    scene = begin(folder)
    body, plate = cube("Box", cuts=1), cube("plate", at=(3, 0, 0))
    shown = drawn()
    assert shown["texts"] == ["Body", "Obstacle", "Neither"] and {"ground", "height", "friction"} <= shown["properties"]
    part("OBSTACLE", plate)
    part("BODY", body)
    body.pdvol.preset = "OWN"
    body.pdvol.pins = "held"
    bpy.ops.pdvol.region(remove=-1)
    shown = drawn()
    assert {"young", "vertices", "reach", "repair", "group"} <= shown["properties"]
    assert {"pdvol.check", "pdvol.preview", "pdvol.refine", "pdvol.wedge"} <= shown["buttons"]
    assert "pdvol.cancel" not in shown["buttons"]
    bpy.ops.pdvol.region(remove=0)
    body.pdvol.pins = ""
    assert hooks.status() is None and bpy.ops.pdvol.check() == {"FINISHED"}
    button = SimpleNamespace(task=tasks.session.task)
    sent = lambda key: operators.PDVOL_OT_check.modal(button, bpy.context, SimpleNamespace(type=key))
    assert hooks.status().startswith("pdvol: Check") and hooks.status().endswith("(Esc stops it)")
    assert sent("G") == {"PASS_THROUGH"} and tasks.session.busy
    assert sent("ESC") == {"CANCELLED"} and not tasks.session.busy
    assert tasks.session.message == "Check: cancelled" and hooks.status() is None
    assert bpy.ops.pdvol.preview() == {"FINISHED"} and "Esc" not in hooks.status()
    assert sent("ESC") == {"FINISHED"} and tasks.session.busy and "pdvol.cancel" in drawn()["buttons"]
    assert wait() == "" and "Preview: done" in drawn()["texts"]
    for scene.pdvol.level in (0, 2):
        assert "Levels 0 to 0 are stored; level 0 is shown" in drawn()["texts"]
    scene.pdvol.count = 2
    assert press("wedge") == "" and {"pdvol.choose"} <= drawn()["buttons"]
    body.location.z = 0.0
    assert press("check") and any("ground" in text for text in drawn()["texts"])


class Layout:
    """Takes what a panel draws, and refuses properties and buttons that do not exist."""

    def __init__(self, found: dict):
        self.found = found

    def row(self, **_: object) -> "Layout":
        return Layout(self.found)

    column = box = row

    def prop(self, data: object, name: str, text: str = "") -> None:
        getattr(data, name)
        self.found["properties"].add(name)

    def prop_search(self, data: object, name: str, inside: object, names: str, text: str = "") -> None:
        getattr(inside, names)
        self.prop(data, name)

    def template_icon_view(self, data: object, name: str, **_: object) -> None:
        self.prop(data, name)

    def operator(self, name: str, text: str | None = None, **_: object) -> object:
        group, _, short = name.partition(".")
        getattr(getattr(bpy.ops, group), short).get_rna_type()
        self.found["buttons"].add(name)
        self.label(text)
        return SimpleNamespace()

    def label(self, text: str | None) -> None:
        self.found["texts"] += [text] if text else []

    def progress(self, text: str, factor: float) -> None:
        assert text and 0.0 <= factor <= 1.0


def drawn() -> dict:
    """The properties, buttons and texts that the panels show now."""
    found: dict = {"properties": set(), "buttons": set(), "texts": []}
    context = SimpleNamespace(scene=bpy.context.scene, object=bpy.context.object, region=SimpleNamespace(width=280))
    for kind in panel.CLASSES:
        own = SimpleNamespace(layout=Layout(found), command="", source="")
        if hasattr(kind, "_draw_levels"):
            own._draw_levels = lambda context, own=own, kind=kind: kind._draw_levels(own, context)
        kind.draw(own, context)
    found["texts"] = [text for text in found["texts"] if text not in ("Add Region",)]
    return found


def pdvol_is_installed_into_an_environment_of_its_own(folder: Path) -> None:
    """Install makes a virtual environment beside the extension and takes pdvol from there from then on. The package is
    a wheel of a few lines here, which needs no net; pip installs it as any other.
    """
    begin(folder)
    wheel = folder / "pdvol-9.9-py3-none-any.whl"
    info = "pdvol-9.9.dist-info"
    with zipfile.ZipFile(wheel, "w") as made:
        made.writestr(
            "pdvol_echo.py", "import sys\ndef main(): print('pdvol: called with', *sys.argv[1:]); sys.exit(2)\n"
        )
        made.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: pdvol\nVersion: 9.9\n")
        made.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        made.writestr(f"{info}/entry_points.txt", "[console_scripts]\npdvol = pdvol_echo:main\n")
        made.writestr(f"{info}/RECORD", "")
    os.environ.pop("PDVOL_COMMAND")
    search = os.environ["PATH"]
    os.environ["PATH"] = str(folder)  # no pdvol, and no Python
    assert "there is no Python 3.12 or newer" in press("install")
    part("BODY", cube("Box", cuts=1))
    assert press("check").startswith("pdvol is not installed: press Install")
    os.environ["PATH"] = search
    python, own = environment.install_commands(environment.own_folder(), str(wheel))[0][0], environment.own_folder()
    for words in environment.install_commands(own, str(wheel))[:2]:
        tasks.session.start(Task("Install", [words]), Places(own / "install.blend"), (), 1.0)
        assert wait() == "", tasks.session.error
    assert Path(python).name.startswith("python3") and (own / "venv" / "pyvenv.cfg").is_file()
    os.environ["PATH"] = str(folder)
    assert environment.pdvol_words(bpy.context) == [str(own / "venv" / "bin" / "pdvol")]
    assert press("check").startswith("called with check ") and "--json" in tasks.session.error
    assert wheel.is_file() and not (folder / "venv").exists()


def the_extension_is_installed(folder: Path) -> None:
    """From its zip, as a user does; then it is switched off and on, and finds its own folder."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    repository = bpy.context.preferences.extensions.repos.new(
        name="Local", module="pdvol_test", custom_directory=str(folder / "repo")
    )
    repository.use_custom_directory = True
    (folder / "repo").mkdir(exist_ok=True)
    assert bpy.ops.extensions.package_install_files(
        filepath=os.environ["PDVOL_ZIP"], repo="pdvol_test", enable_on_install=True
    ) == {"FINISHED"}
    name = "bl_ext.pdvol_test.pdvol"
    assert name in bpy.context.preferences.addons and hasattr(bpy.ops.pdvol, "preview")
    assert sys.modules[name].__file__.startswith(str(folder))
    environment = sys.modules[f"{name}.addon.environment"]
    preferences = bpy.context.preferences.addons[name].preferences
    assert environment.PACKAGE == name and preferences.source == ""
    assert environment.own_folder().is_dir() and "pdvol" in environment.own_folder().parts
    words, own = os.environ.pop("PDVOL_COMMAND"), sys.modules[f"{name}.addon.tasks"]
    preferences.command = words
    assert environment.pdvol_words(bpy.context) == shlex.split(words)
    scene = bpy.context.scene
    scene.frame_end = 5
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    end = time.monotonic() + SAFETY
    while own.step(bpy.context):
        assert time.monotonic() < end
        time.sleep(0.05)
    assert own.session.error == "" and (folder / "shot_pdvol" / "play" / "1" / "level_0" / "Box.pc2").is_file()
    bpy.ops.preferences.addon_disable(module=name)
    assert not hasattr(bpy.types.Scene, "pdvol")
    bpy.ops.preferences.addon_enable(module=name)
    assert hasattr(bpy.types.Scene, "pdvol")


if __name__ == "__main__":
    carry_out(globals())
