"""Names that a user chooses from, and where each one is implemented; nothing is loaded before it is needed.

A new interpolant, export format or command is one file and one line here. Interpolants, formats
and commands can also come from another installed package, through entry points of the groups `pdvol.interpolants`,
`pdvol.formats` and `pdvol.commands`. A name of pdvol's own comes before the same name of another package.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

from pdvol.errors import InputError


@dataclass(frozen=True)
class Entry:
    """One name's implementation.

    Attributes
    ----------
    target : "module:object", or "module" alone
    help : one line, for command lines that list the names
    package : the installed package it comes from; empty for pdvol's own
    """

    target: str
    help: str = ""
    package: str = ""

    def load(self) -> Any:
        """The module or object, imported now."""
        module, _, name = self.target.partition(":")
        loaded = import_module(module)
        for part in name.split(".") if name else ():
            loaded = getattr(loaded, part)
        return loaded


class Registry:
    """The names of one kind. Iterating gives the names; `registry[name]` imports what a name stands for.

    Parameters
    ----------
    noun : what one entry is called in messages
    entries : pdvol's own entries by name, in the order in which they are listed
    group : the entry point group that other packages extend it by; None where they cannot
    """

    def __init__(self, noun: str, entries: Mapping[str, Entry], group: str | None = None):
        self.noun, self.group = noun, group
        self._own = dict(entries)

    @cached_property
    def _installed(self) -> dict[str, Entry]:
        """Entries of other installed packages; these are looked up once, when a name is not pdvol's own or all are
        listed.
        """
        if self.group is None:
            return {}
        from importlib.metadata import entry_points

        found: dict[str, Entry] = {}
        for point in entry_points(group=self.group):
            package = point.dist.name if point.dist is not None else "another package"
            found.setdefault(point.name, Entry(point.value, f"from the package {package}", package))
        return {name: entry for name, entry in found.items() if name not in self._own}

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
            return self._own[name].load()
        entry = self._installed[name]
        try:
            return entry.load()
        except Exception as error:  # another package's code may fail in any way
            raise InputError(
                f"the {self.noun} {name!r} of the package {entry.package} cannot be loaded:"
                f" {type(error).__name__}: {error}"
            ) from error

    def help(self, name: str) -> str:
        """The line that command lines show beside a name; InputError where the name is unknown."""
        self.check(name)
        return (self._own.get(name) or self._installed[name]).help


METHODS = ("progressive", "direct", "tracks", "embedded")
"""How a level above the coarsest is marched (`pdvol.integrate.level_march`); the first one is the default."""

ELEMENTS = ("smoothed", "linear")
"""The finite elements of a body (`pdvol.potentials.assembly.domains`); the first one is the default."""

INTERPOLANTS = Registry(
    "prolongation",
    {
        "barycentric": Entry("pdvol.levels.interpolants.barycentric:barycentric"),
        "biharmonic": Entry("pdvol.levels.interpolants.biharmonic:biharmonic"),
        "phong": Entry("pdvol.levels.interpolants.phong:phong"),
    },
    "pdvol.interpolants",
)
"""Functions (coarse, fine, binding) -> weights (n_fine, n_coarse); see `pdvol.levels.interpolants`. The first one is
the default.
"""

INTEGRATORS = Registry(
    "integrator",
    {
        "bdf2": Entry("pdvol.integrate.integrator:BDF2"),
        "implicit_euler": Entry("pdvol.integrate.integrator:ImplicitEuler"),
    },
)
"""Time integrators (`pdvol.integrate.integrator`). The first one is the default."""

FORMATS = Registry(
    "format",
    {
        "xdmf": Entry("pdvol.studio.export.xdmf:export"),
        "obj": Entry("pdvol.studio.export.obj:export"),
        "usd": Entry("pdvol.studio.export.usd:export"),
        "pc2": Entry("pdvol.studio.export.pc2:export"),
        "alembic": Entry("pdvol.studio.export.alembic:export"),
    },
    "pdvol.formats",
)
"""Functions (run, levels, out, fields) -> list of written paths; see `pdvol.studio.export`."""

SHOWN_SURFACES = ("render", "contact", "both")
"""Which surface of a body with render meshes is exported: these meshes (the default), the simulated one, or both."""

STUDIO = Registry(
    "tool",
    {
        "play": Entry("pdvol.studio.play.notebook:play"),
        "player": Entry("pdvol.studio.live.player:Player"),
        "polyfem_scene": Entry("pdvol.studio.imports.polyfem:polyfem_scene"),
        "read_animation": Entry("pdvol.studio.imports.scene_files:read_animation"),
        "files_of_scene": Entry("pdvol.studio.imports.scene_files:files_of_scene"),
        "read_still": Entry("pdvol.studio.imports.scene_files:read_still"),
    },
)
"""The functions of `pdvol.studio` that the core calls. It imports nothing of the studio, and finds them here."""

COMMANDS = Registry(
    "command",
    {
        "run": Entry("pdvol.commands.run", "simulate a scene's levels, coarse to fine"),
        "preview": Entry("pdvol.commands.preview", "simulate level 0 only"),
        "refine": Entry("pdvol.commands.refine", "simulate the finer levels of a stored run"),
        "live": Entry("pdvol.commands.live", "a local page: level 0 runs while one looks and changes values"),
        "check": Entry("pdvol.commands.check", "pre-flight: what will be modelled, sizes, and every defect found"),
        "repair": Entry("pdvol.commands.repair", "mend a mesh into another file: weld, fill, orient, uncross"),
        "hierarchy": Entry("pdvol.commands.hierarchy", "build the levels of one mesh and report their bindings"),
        "info": Entry("pdvol.commands.info", "what a scene will model, or what a run holds"),
        "metrics": Entry(
            "pdvol.commands.metrics",
            "measure a run: continuity, consistency between levels, and more; writes metrics.json and metrics.png into"
            " it",
        ),
        "render": Entry("pdvol.commands.render", "draw a run: rows are levels, columns are moments"),
        "play": Entry(
            "pdvol.commands.play", "write runs as one HTML file that plays them in a browser, without a network"
        ),
        "export": Entry(
            "pdvol.commands.export",
            "write a run's levels for ParaView (xdmf) or animation software (usd, pc2, alembic, obj)",
        ),
        "study": Entry(
            "pdvol.commands.study", "speed against accuracy: run a scene with many settings and compare them"
        ),
        "wedge": Entry("pdvol.commands.wedge", "many variations of a scene on level 0, scored and on one sheet"),
        "pick": Entry("pdvol.commands.pick", "take one variation of a wedge, and refine it"),
        "verify": Entry(
            "pdvol.commands.verify",
            "check every stored state for intersections and inverted cells, independently of the solver",
        ),
    },
    "pdvol.commands",
)
"""Modules with `add_arguments(parser)` and `main(options) -> int | None`, by the verb of the command line."""
