"""Names that a user chooses from, and where each one is implemented; nothing is loaded before it is needed.

A new interpolant, export format or command is one file and one line here. Interpolants, formats
and commands can also come from another installed package, through entry points of the groups `pdvol.interpolants`,
`pdvol.formats` and `pdvol.commands`. A name of pdvol's own comes before the same name of another package.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from pdvol.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


class Registry:
    """The names of one kind. Iterating gives the names; `registry[name]` imports what a name stands for.

    Parameters
    ----------
    noun : what one entry is called in messages
    entries : where pdvol's own ones are, "module:object" or "module", by name, in the order in which they are listed
    group : the entry point group that other packages extend it by; None where they cannot
    helps : a line for command lines by name
    """

    def __init__(
        self, noun: str, entries: Mapping[str, str], group: str | None = None, helps: Mapping[str, str] | None = None
    ):
        self.noun, self.group, self._own, self._helps = noun, group, entries, helps or {}

    @cached_property
    def _installed(self) -> "dict[str, EntryPoint]":
        """Those of other installed packages; looked up once, when a name is not pdvol's own or all are listed."""
        if self.group is None:
            return {}
        from importlib.metadata import entry_points

        found: dict[str, EntryPoint] = {}
        for point in entry_points(group=self.group):
            found.setdefault(point.name, point)
        return {name: point for name, point in found.items() if name not in self._own}

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._installed

    def __len__(self) -> int:
        return len(self._own) + len(self._installed)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._own or name in self._installed)

    def check(self, name: str) -> None:
        """Raise InputError, listing the legal names, unless `name` is one of them."""
        if name not in self:
            raise InputError(f"unknown {self.noun} {name!r}; choose one of {', '.join(self)}")

    def __getitem__(self, name: str) -> Any:
        """What a name stands for, imported on demand.

        Raises
        ------
        InputError
            The name is unknown, or another package's implementation cannot be imported.
        """
        self.check(name)
        if name in self._own:
            module, _, attribute = self._own[name].partition(":")
            return attrgetter(attribute)(import_module(module)) if attribute else import_module(module)
        try:
            return self._installed[name].load()
        except Exception as error:  # another package's code may fail in any way
            raise InputError(
                f"the {self.noun} {name!r} of the {self._package(name)} cannot be loaded:"
                f" {type(error).__name__}: {error}"
            ) from error

    def help(self, name: str) -> str:
        """The line that command lines show beside a name; InputError where the name is unknown."""
        self.check(name)
        return self._helps.get(name, "") if name in self._own else f"from the {self._package(name)}"

    def _package(self, name: str) -> str:
        package = self._installed[name].dist
        return f"package {package.name}" if package is not None else "another package"


METHODS = ("progressive", "direct", "tracks", "embedded")
"""How a level above the coarsest is marched (`pdvol.integrate.level_march`); the first one is the default."""

ELEMENTS = ("smoothed", "linear")
"""The finite elements of a body (`pdvol.potentials.assembly.domains`); the first one is the default."""

INTERPOLANTS = Registry(
    "prolongation",
    {
        "barycentric": "pdvol.levels.interpolants.barycentric:barycentric",
        "biharmonic": "pdvol.levels.interpolants.biharmonic:biharmonic",
        "phong": "pdvol.levels.interpolants.phong:phong",
    },
    "pdvol.interpolants",
)
"""Functions (coarse, fine, binding) -> weights (n_fine, n_coarse); see `pdvol.levels.interpolants`. The first one is
the default.
"""

INTEGRATORS = Registry(
    "integrator",
    {"bdf2": "pdvol.integrate.integrator:BDF2", "implicit_euler": "pdvol.integrate.integrator:ImplicitEuler"},
)
"""Time integrators (`pdvol.integrate.integrator`). The first one is the default."""

FORMATS = Registry(
    "format",
    {
        "xdmf": "pdvol.studio.export.xdmf:export",
        "obj": "pdvol.studio.export.obj:export",
        "usd": "pdvol.studio.export.usd:export",
        "pc2": "pdvol.studio.export.pc2:export",
        "alembic": "pdvol.studio.export.alembic:export",
    },
    "pdvol.formats",
)
"""Functions (run, levels, out, fields) -> list of written paths; see `pdvol.studio.export`."""

SHOWN_SURFACES = ("render", "contact", "both")
"""Which surface of a body with render meshes is exported: these meshes (the default), the simulated one, or both."""

STUDIO = Registry(
    "tool",
    {
        "play": "pdvol.studio.play.notebook:play",
        "player": "pdvol.studio.live.player:Player",
        "polyfem_scene": "pdvol.studio.imports.polyfem:polyfem_scene",
        "read_animation": "pdvol.studio.imports.scene_files:read_animation",
        "files_of_scene": "pdvol.studio.imports.scene_files:files_of_scene",
        "read_still": "pdvol.studio.imports.scene_files:read_still",
    },
)
"""The functions of `pdvol.studio` that the core calls. It imports nothing of the studio, and finds them here."""

COMMAND_HELP = {
    "run": "simulate a scene's levels, coarse to fine",
    "preview": "simulate level 0 only",
    "refine": "simulate the finer levels of a stored run",
    "live": "a local page: level 0 runs while one looks and changes values",
    "check": "pre-flight: what will be modelled, sizes, and every defect found",
    "repair": "mend a mesh into another file: weld, fill, orient, uncross",
    "hierarchy": "build the levels of one mesh and report their bindings",
    "info": "what a scene will model, or what a run holds",
    "metrics": "measure a run: continuity, consistency between levels, and more; writes metrics.json and metrics.png",
    "render": "draw a run: rows are levels, columns are moments",
    "play": "write runs as one HTML file that plays them in a browser, without a network",
    "export": "write a run's levels for ParaView (xdmf) or animation software (usd, pc2, alembic, obj)",
    "study": "speed against accuracy: run a scene with many settings and compare them",
    "wedge": "many variations of a scene on level 0, scored and on one sheet",
    "pick": "take one variation of a wedge, and refine it",
    "verify": "check every stored state for intersections and inverted cells, independently of the solver",
}
"""The verbs of the command line, as its help lists them."""

COMMANDS = Registry(
    "command", {name: f"pdvol.commands.{name}" for name in COMMAND_HELP}, "pdvol.commands", COMMAND_HELP
)
"""Modules with `add_arguments(parser)` and `main(options) -> int | None`, by the verb of the command line."""
