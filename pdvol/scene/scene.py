"""A shot: everything that is described once, for all levels."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any, get_args

from pdvol.registry import ELEMENTS, INTEGRATORS
from pdvol.scene.attachments import Attachment, Pull
from pdvol.scene.bodies import Body, Separate, jittered
from pdvol.scene.checks import choice, count, finite, instance, optional, positive, require, several
from pdvol.scene.contact import Barrier, Friction
from pdvol.scene.element import NOT_SIMULATED, Element
from pdvol.scene.hand import Hand
from pdvol.scene.loads import Impulse, Load
from pdvol.scene.muscles import Muscle
from pdvol.scene.solver import Penalty, Solver
from pdvol.scene.surroundings import Obstructing, Rigid, Support, led

MOST_STEPS = 10_000_000  # a larger number is a typing error


@dataclass(frozen=True, repr=False)
class Scene(Element):
    """A shot. Everything below is described once, for all levels.

    Attributes
    ----------
    bodies : sequence of Body, with names of their own and equally many levels
    dt : time step [s]
    steps : number of time steps
    loads : sequence of Gravity, Force, PointForce, Impulse, Flow and Pressure
    supports : sequence of Support
    obstacles : sequence of Plane, Rigid and Deforming
    contact : `(Barrier(),)` or `(Barrier(), Friction(mu))`; without it nothing touches
    penalty : Penalty, which holds levels together
    solver : Solver
    name : of the shot, and of its run folder
    separate : sequence of Separate: what may be done, in order, where bodies meet at t = 0; refused when empty
    integrator : "bdf2", which is second order in dt, or "implicit_euler"
    feedback : fraction, 0 to 1, of its drift from the level below that a progressive level makes up for in each step
    attachments : sequence of Attachment, springs between bodies
    muscles : sequence of Muscle, parts of bodies that contract
    elements : "smoothed", which do not lock, or "linear"; a body may have others
    pulls : sequence of Pull, springs that draw bodies to points that move
    hand : Hand, whose pulls and shifts are played again; `pdvol run --hand` gives it

    Raises
    ------
    InputError
        A field has no legal value, or two of them do not fit.
    """

    bodies: Sequence[Body]
    dt: float
    steps: int
    loads: Sequence[Load] = ()
    supports: Sequence[Support] = ()
    obstacles: Sequence[Obstructing] = ()
    contact: Sequence[Barrier | Friction] = ()
    penalty: Penalty = Penalty()
    solver: Solver = field(default_factory=Solver)
    name: str = "scene"
    separate: Sequence[Separate] = ()
    integrator: str = next(iter(INTEGRATORS))
    feedback: float = 0.05
    attachments: Sequence[Attachment] = ()
    muscles: Sequence[Muscle] = ()
    elements: str = ELEMENTS[0]
    pulls: Sequence[Pull] = ()
    hand: Hand | None = field(default=None, metadata={NOT_SIMULATED: True})  # it may grow: `same_up_to` compares it

    whose = ""
    checks = {
        "bodies": several(Body, "Body(shape, material)"),
        "dt": positive,
        "steps": partial(count, lowest=0, highest=MOST_STEPS),
        "loads": several(Load, ", ".join(kind.__name__ for kind in get_args(Load))),
        "supports": several(Support, "Support(where)"),
        "obstacles": several(Obstructing, ", ".join(kind.__name__ for kind in get_args(Obstructing))),
        "contact": several(Barrier | Friction, "Barrier() and Friction(mu)"),
        "separate": several(Separate, "Separate(by, limit)"),
        "integrator": lambda _, value: INTEGRATORS.check(value),
        "feedback": partial(finite, lowest=0.0, highest=1.0),
        "attachments": several(Attachment, "Attachment(body, other, where)"),
        "muscles": several(Muscle, "Muscle(body, fibre, strength)"),
        "elements": choice(*ELEMENTS),
        "pulls": several(Pull, "Pull(body, where, times, points)"),
        "hand": optional(instance(Hand)),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("obstacles", "supports"):
            object.__setattr__(self, key, led(getattr(self, key), self.hand, self.dt))
        called = [o.name for o in self.obstacles]
        movable = (o.name for o in self.obstacles if isinstance(o, Rigid) and o.movable)
        require(all(called.count(name) == 1 for name in movable), f"what is movable needs another name, not {called}")
        require(len(self.bodies) > 0, "a scene needs at least one body")
        names = [b.name for b in self.bodies]
        require(len(set(names)) == len(names), f"bodies must have different names, not {names}")
        counts = {b.levels for b in self.bodies}
        require(len(counts) == 1, f"all bodies need the same number of levels, not {sorted(counts)}")
        for element in (*self.supports, *self.loads, *self.muscles, *self.attachments, *self.pulls):
            some = ("", *names) if isinstance(element, (Support, *get_args(Load))) else names
            article = "an" if isinstance(element, Attachment | Impulse) else "a"
            for name in (getattr(element, key) for key in ("body", "other") if hasattr(element, key)):
                require(name in some, f"{article} {type(element).__name__} names the body {name!r}; there are {names}")
        for kind in (Barrier, Friction):
            require(sum(isinstance(c, kind) for c in self.contact) <= 1, f"contact names more than one {kind.__name__}")
        self._check_pairs(names, [getattr(o, "name", "") for o in self.obstacles])
        if any(isinstance(c, Friction) for c in self.contact) or self.obstacles:
            require(
                any(isinstance(c, Barrier) for c in self.contact),
                "friction and obstacles need contact=(Barrier(), ...)",
            )

    def _check_pairs(self, bodies: list[str], obstacles: list[str]) -> None:
        """That friction's pairs name what can touch."""
        for one, other, _ in (pair for c in self.contact if isinstance(c, Friction) for pair in c.triples):
            for name in (one, other):
                require(
                    name in bodies or name in obstacles,
                    f"Friction.pairs names {name!r}; there are {[*bodies, *obstacles]}",
                )
                require(
                    name not in bodies or name not in obstacles,
                    f"Friction.pairs: {name!r} is a body and an obstacle; rename one of them",
                )
            require(
                one in bodies or other in bodies,
                f"Friction.pairs names the obstacles {one!r} and {other!r}, which never touch",
            )

    @property
    def played(self) -> Hand | None:
        """Its hand, while level 0 is played."""
        return self.hand if self.hand is not None and self.hand.channel is not None else None

    @property
    def levels(self) -> int:
        """How many levels the scene has."""
        return self.bodies[0].levels

    @property
    def model(self) -> str:
        """The model in words: "the paper's", or how its shots are integrated, discretised and held together."""
        kinds = dict.fromkeys(self.elements_of(body) for body in self.bodies)
        if (self.integrator, *kinds, self.feedback) == tuple(MODELS["paper"].values()):
            return "the paper's (implicit Euler, linear elements, no drift feedback)"
        feedback = f"drift feedback {self.feedback:g}" if self.feedback else "no drift feedback"
        return f"{self.integrator}, {' and '.join(kinds)} elements, {feedback}"

    def elements_of(self, body: Body) -> str:
        """The kind of elements of one of its bodies."""
        return body.elements or self.elements

    def with_settings(self, **settings: Any) -> "Scene":
        """The same scene with some of `SETTINGS` replaced.

        The number of steps stays when `dt` changes. `jitter` is a pair (speed [m/s], seed): see `jittered`. `model` is
        one of `MODELS`, several settings at once; others that are given replace its own.
        """
        unknown = set(settings) - SETTINGS.keys()
        require(not unknown, f"unknown setting {sorted(unknown)}; there are {sorted(SETTINGS)}")
        jitter, bodies = settings.pop("jitter", None), self.bodies
        model = settings.pop("model", "")
        if model:
            require(model in MODELS, f"model = {model!r} must be {' or '.join(MODELS)}")
            settings = MODELS[model] | settings
            bodies = tuple(replace(body, elements=None) for body in bodies)
        parts: dict[str, dict[str, Any]] = {"scene": {}, "solver": {}, "penalty": {}, "Barrier": {}, "Friction": {}}
        for name, value in settings.items():
            parts[SETTINGS[name]][name.rpartition(".")[2]] = value
        contact = [replace(c, **parts[type(c).__name__]) for c in self.contact]
        for kind in ("Barrier", "Friction"):
            missing = parts[kind] and not any(type(c).__name__ == kind for c in self.contact)
            require(not missing, f"{', '.join(parts[kind])}: the scene has no {kind} that could have it")
        return replace(
            self,
            **parts["scene"],
            bodies=bodies if jitter is None else jittered(bodies, jitter),
            contact=tuple(contact),
            solver=replace(self.solver, **parts["solver"]),
            penalty=replace(self.penalty, **parts["penalty"]),
        )


MODELS = {"paper": {"integrator": "implicit_euler", "elements": "linear", "feedback": 0.0}}
"""Settings by the model that they make: "paper" is the method as the paper has it."""

SETTINGS = {
    **{f.name: part for part, kind in (("solver", Solver), ("penalty", Penalty)) for f in fields(kind)},
    "dhat": "Barrier",
    "barrier.stiffness": "Barrier",
    "friction.iterations": "Friction",
    "dt": "scene",
    "steps": "scene",
    "integrator": "scene",
    "elements": "scene",
    "jitter": "scene",
    "model": "scene",
    "feedback": "scene",
}
"""What `--set` reaches in every scene, and the part of the scene that holds it."""
