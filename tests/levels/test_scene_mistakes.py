"""Mistakes in the parts of a scene are named on one line, when they are made or when a level is checked."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
import ufl

import pdvol
from pdvol import Attachment, Flow, Force, Friction, Gravity, Impulse, Keyed, Material, Muscle, NeoHookean, Path
from pdvol.errors import InputError
from pdvol.levels.scene_fields import check_fields
from pdvol.scene import Posed, Pressure, Pull, Region, Rotation, Separate, Sequential, Support, Translation, moved
from problems import SOFT, ground, make_scene
from shapes import box, together

ONE = box(2, 2)
SQUARES = together(ONE, box(2, 2, (1.2, 0.1), 2.0))


def right(X):
    return X[:, 0] > 1.0 - 1e-9


def fails(*_):
    return 1 / 0


def attachment(where=right, other="body 1", **more):
    return Attachment("body 0", other, where, **more)


def muscle(fibre=(1.0, 0.0), strength=3e4, body="body 0", **more):
    return Muscle(body, fibre, strength, **more)


def pull(where=(0.0, 0.0), times=(0.0, 1.0), points=((0.0, 0.0), (1.0, 0.0)), body="body 0", **more):
    return Pull(body, where, times, points, **more)


def posed(rest=ONE.points, cells=ONE.cells, positions=ONE.points, **more):
    return Posed(rest, cells, positions, **more)


class Takes(Material):
    @staticmethod
    def psi(F, mu):
        return mu * ufl.tr(F)


@dataclass(frozen=True)
class Along(Material):
    fibre: object = (1.0, 0.0)

    @staticmethod
    def psi(F, mu, lmbda, fibre):
        return NeoHookean.psi(F, mu, lmbda) + fibre


class Gives(Material):
    @staticmethod
    def psi(F, mu, lmbda):
        return mu * F


MISTAKES = [
    ("loads", lambda: "gravity", "not str"),
    ("loads", lambda: Gravity((0.0, 0.0, -9.81)), "3 components in a 2D scene"),
    ("loads", lambda: Gravity(lambda t: (0.0, 0.0, 1.0)), "gravity must give an array of shape"),
    ("loads", lambda: Force(3.0), "Force"),
    ("loads", lambda: Force(lambda t: (np.nan, t)), "NaN"),
    ("loads", lambda: Force((1.0, 0.0), lambda X: X[:, 0] > 9.0), "Force holds no vertex of level 0"),
    ("loads", lambda: Force((1.0, 0.0), lambda X: X[:, 5]), "`where` failed"),
    ("loads", lambda: Force((1.0, 0.0), body="nobody"), "nobody"),
    ("loads", lambda: pdvol.PointForce((1.0, 0.0), (5.0, 5.0)), "far outside"),
    ("loads", lambda: Impulse((1.0, 0.0, 0.0)), "3 components"),
    ("loads", lambda: Impulse((1.0, 0.0), -1.0), "Impulse"),
    ("loads", lambda: Flow(lambda x, t: x[:, 0]), "Flow.velocity must give an array of shape"),
    ("loads", lambda: Flow((1.0, 2.0, 3.0)), "3 components"),
    ("loads", lambda: Flow((1.0, 0.0), density=0.0), "Flow"),
    ("loads", lambda: Flow((1.0, 0.0), drag=-1.0), "Flow"),
    ("loads", lambda: Pressure("body 0", lambda t: np.nan), "Pressure.pressure gives NaN"),
    ("loads", lambda: Pressure("body 0", lambda t: (1.0, 2.0)), "Pressure.pressure must give an array of shape"),
    ("loads", lambda: Pressure("body 0", fails), "Pressure.pressure failed"),
    ("loads", lambda: Pressure("b", 1.0), "Pressure names the body 'b'"),
    ("loads", lambda: Pressure("body 0", np.inf), "is not a finite number"),
    ("attachments", lambda: "body 0", "attachments hold"),
    ("attachments", lambda: attachment(lambda X: X[:, 0] > 9.0), "where holds no boundary facet of body 'body 0'"),
    ("attachments", lambda: attachment(to=lambda X: X[:, 0] > 9.0), "to holds no boundary facet of body 'body 1'"),
    ("attachments", lambda: attachment((0.0, 9.0)), "Attachment.where = (0.0, 9.0) lies far outside body 0"),
    ("attachments", lambda: attachment(to=(0.0, 0.5)), "Attachment.to = (0.0, 0.5) lies far outside body 1"),
    ("attachments", lambda: attachment((0.0, 0.0, 0.0)), "3 components in a 2D scene"),
    ("attachments", lambda: attachment((1.0,)), "Attachment"),
    ("attachments", lambda: attachment(lambda X: X[:3, 0] > 0), "must give an array of shape"),
    ("attachments", lambda: attachment(lambda X: X[:, 0]), "must give True or False"),
    ("attachments", lambda: attachment(stiffness=0.0), "Attachment"),
    ("attachments", lambda: attachment(rest_length=-1.0), "Attachment"),
    ("attachments", lambda: attachment(breaking=0.0), "Attachment"),
    ("attachments", lambda: attachment(other="body 0"), "to itself"),
    ("attachments", lambda: attachment(other="c"), "names the body 'c'"),
    ("muscles", lambda: muscle(where=lambda X: X[:, 0] > 9.0), "Muscle.where holds no cell of body 'body 0'"),
    ("muscles", lambda: muscle(where=3), "Muscle"),
    ("muscles", lambda: muscle((1.0, 0.0, 0.0)), "Muscle.fibre has 3 components in a 2D scene"),
    ("muscles", lambda: muscle((0.0, 0.0)), "Muscle"),
    ("muscles", lambda: muscle(lambda X: 0.0 * X), "Muscle.fibre gives NaN"),
    ("muscles", lambda: muscle(strength=0.0), "Muscle"),
    ("muscles", lambda: muscle(activation=-0.1), "Muscle"),
    ("muscles", lambda: muscle(activation=lambda t, X: -1.0 + 0.0 * X[:, 0]), "Muscle.activation is negative"),
    ("muscles", lambda: muscle(activation=fails), "Muscle.activation failed: ZeroDivisionError"),
    ("muscles", lambda: muscle(activation=lambda t, X: 1.0), "Muscle.activation must give an array of shape"),
    ("muscles", lambda: muscle(body="b"), "a Muscle names the body 'b'"),
    ("pulls", lambda: pull(times=(0.0, 0.0)), "must ascend"),
    ("pulls", lambda: pull(times=(0.0, 0.5, 1.0)), "3 times and 2 points"),
    ("pulls", lambda: pull(points=((0.0, 0.0), (1.0, np.nan))), "not a finite number"),
    ("pulls", lambda: pull(points=((0.0, 0.0), (1.0, 0.0, 0.0))), "two or all three"),
    ("pulls", lambda: pull(stiffness=0.0), "must be positive"),
    ("pulls", lambda: pull(radius=-1.0), "must be positive"),
    ("pulls", lambda: pull(body="c"), "names the body 'c'"),
    ("pulls", lambda: pull((9.0, 0.0)), "far outside"),
    ("pulls", lambda: pull((0.0,) * 3, points=[(0.0,) * 3] * 2), "3 components"),
    ("contact", lambda: Friction(0.3, pairs={("body 0", "flor"): 0.1}), "flor"),
    ("contact", lambda: Friction(0.3, pairs={("floor", "floor"): 0.1}), "never touch"),
    ("contact", lambda: Friction(0.3, pairs={("body 0", "floor"): -1.0}), "below"),
    ("contact", lambda: Friction(0.3, pairs={"floor": 0.1}), "look like"),
    ("contact", lambda: Friction(0.3, pairs={("body 0", "floor"): 0.1, ("floor", "body 0"): 0.2}), "twice"),
    ("contact", lambda: Friction(0.3, pairs={("body 0", "floor"): "much"}), "finite"),
    ("contact", lambda: Friction(0.3, pairs={("a", "b", "c"): 0.1}), "look like"),
    ("separate", lambda: "move", "separate"),
    ("separate", lambda: Separate("push"), "push"),
    ("separate", lambda: Separate("move", 0.0), "0.0"),
    ("separate", lambda: Separate("shrink", 1.0), "1.0"),
    ("material", lambda: NeoHookean(-1.0), "young"),
    ("material", lambda: NeoHookean("soft"), "young"),
    ("material", lambda: NeoHookean(1.0, 0.5), "poisson"),
    ("material", lambda: NeoHookean(1.0, density=0.0), "density"),
    ("material", lambda: NeoHookean(1.0, damping=-1.0), "damping"),
    ("material", lambda: NeoHookean(lambda X: X[:, 0] - 0.5), "positive"),
    ("material", lambda: NeoHookean(lambda X: X), "shape"),
    ("material", lambda: NeoHookean(lambda X: np.nan * X[:, 0]), "finite"),
    ("material", lambda: NeoHookean(fails), "ZeroDivision"),
    ("material", lambda: NeoHookean(1e5, density=Keyed((1.0, 3.0), (2.0, 6.0))), "NeoHookean.density cannot be Keyed"),
    ("material", lambda: NeoHookean(Keyed((0.0, 1.0), (1.0, 0.0))), "its lowest key, = 0.0 must be positive"),
    ("material", lambda: NeoHookean(Keyed((0.0,), (1.0,))), "give as many, two at least"),
    ("material", lambda: NeoHookean(Keyed((0.0, 1.0), (1.0,))), "give as many"),
    ("material", lambda: NeoHookean(Keyed((1.0, 0.0), (1.0, 2.0))), "must ascend"),
    ("material", lambda: NeoHookean(Keyed((0.0, 1.0), (1.0, np.nan))), "is not a finite number"),
    ("material", lambda: Takes(1.0), "psi"),
    ("material", lambda: Gives(1.0), "one number"),
    ("material", lambda: Along(1.0, fibre=(1.0, 0.0, 0.0)), "Along.fibre = (1.0, 0.0, 0.0) must have 2 components"),
    ("material", lambda: Along(1.0, fibre=lambda X: X[:, [0, 1, 0]]), "an array of shape (8,) or (8, 2), not (8, 3)"),
    ("material", lambda: Along(1.0, fibre=lambda X: np.nan * X), "finite"),
    ("material", lambda: Along(1.0, fibre=(1.0, "a")), "Along.fibre = 'a' is not a finite number"),
    ("material", lambda: Along(1.0, fibre=ufl.as_vector((1.0, 0.0))), "Along.fibre is UFL; give numbers, as (1.0, "),
    ("material", lambda: Along(1.0), "Along.psi(F, mu, lmbda, fibre) failed"),
    ("material", lambda: Material(1.0), "must define psi"),
    ("regions", lambda: SOFT, "region"),
    ("regions", lambda: Region(2e5, right), "Region"),
    ("regions", lambda: Region(SOFT, ()), "Region"),
    ("regions", lambda: Region(SOFT, "left"), "Region"),
    ("regions", lambda: Region(SOFT, lambda X: X[:, 0] > 9), "holds no cell"),
    ("regions", lambda: Region(SOFT, 4), "labels there are [0]"),
    ("regions", lambda: Region(SOFT, lambda X: X), "shape"),
    ("regions", lambda: Region(SOFT, fails), "ZeroDivision"),
    ("start", lambda: np.zeros((9, 2)), "start must be a function of rest positions"),
    ("start", lambda: lambda X: X * (-1.0, 1.0), "turns 8 of 8 cells inside out or flat, as cell"),
    ("start", lambda: lambda X: X * (1.0, 0.0), "turns 8 of 8 cells inside out or flat, as cell 0 at (0.3333, 0.1667)"),
    ("start", lambda: lambda X: X[:, 0], "the start of body 'body 0' must give an array of shape (9, 2), not (9,)"),
    ("start", lambda: lambda X: X * np.nan, "level 0: the start of body 'body 0' gives NaN or infinity"),
    ("start", lambda: lambda X: X * 1e200, "leads a vertex 1e+200 m away, where coordinates of a body of 1.41"),
    ("start", lambda: lambda X: X.astype(str), "the start of body 'body 0' gives no numbers"),
    ("start", lambda: fails, "the start of body 'body 0' failed: ZeroDivisionError"),
    ("start", lambda: posed(positions=ONE.points[:-1]), "have the shapes (9, 2) and (8, 2)"),
    ("start", lambda: posed(cells=ONE.cells[:, :2]), "Posed.cells has the shape (8, 2); give (m, 3)"),
    ("start", lambda: posed(cells=ONE.cells + 1), "names vertices from 1 to 9; there are 0 to 8"),
    ("start", lambda: posed(cells=ONE.cells + 0.5), "must be whole numbers"),
    ("start", lambda: posed(positions=np.inf * ONE.points), "NaN or infinity"),
    ("start", lambda: posed("rest"), "Posed.rest is no array of numbers"),
    ("start", lambda: posed(tolerance=0.0), "Posed.tolerance = 0.0 must be positive"),
    ("start", lambda: posed(ONE.points + 1.0), "8 of 9 vertices are further than 0.0707 m from its mesh"),
    ("start", lambda: posed(box(3, 1).points, box(3, 1).cells, box(3, 1).points), "is 3D in a 2D scene"),
    ("start", lambda: posed(ONE.points * (1, 0)), "has a flat cell at rest"),
    ("start", lambda: posed(positions=ONE.points * (-1, 1)), "turns 8 of 8 cells inside out"),
    ("supports", lambda: Support("left"), "Support"),
    ("supports", lambda: Support(right, motion=3), "Support"),
    ("supports", lambda: Support(right, release=-1.0), "Support"),
    ("supports", lambda: Support(right, release=np.nan), "Support"),
    ("motion", lambda: Path((0.0,), ((0.0, 0.0),)), "Path"),
    ("motion", lambda: Path((0.0, 0.0), ((0.0, 0.0), (1.0, 0.0))), "Path"),
    ("motion", lambda: Path((0.0, 1.0), ((0.0, 0.0), (1.0, 0.0, 0.0))), "Path"),
    ("motion", lambda: Path((0.0, np.nan), ((0.0, 0.0), (1.0, 0.0))), "Path"),
    ("motion", lambda: Sequential((3,)), "Sequential"),
    ("motion", lambda: Translation((np.nan, 0.0)), "Translation"),
    ("motion", lambda: Translation((1.0, 0.0), stop=-1.0), "Translation"),
    ("motion", lambda: Rotation(1.0, (0.0, 0.0, 0.0), axis=(0.0, 0.0, 0.0)), "Rotation"),
    ("motion", lambda: Rotation(np.inf, (0.0, 0.0)), "Rotation"),
    ("motion", lambda: lambda X, t: X * np.nan, "obstacle 'rock': its motion"),
    ("motion", lambda: lambda X, t: X[:1], "shape"),
    ("motion", lambda: fails, "ZeroDivision"),
    ("motion", lambda: lambda X, t: None, "obstacle 'rock': its motion"),
]


def check(kind, part):
    """Checks a scene of two squares with this part; the first square has what is a part of a body."""
    if kind == "motion":
        moved(part, ONE.points, 0.5, "obstacle 'rock'")
    of_body = {kind: (part,) if kind == "regions" else part} if kind in ("material", "regions", "start") else {}
    parts = {} if of_body else {kind: (pdvol.Barrier(), part) if kind == "contact" else (part,)}
    scene = make_scene((SOFT, SOFT), obstacles=ground(2)[:1] if kind == "contact" else (), **parts)
    one, other = scene.bodies
    check_fields(replace(scene, bodies=(replace(one, **of_body), other)), SQUARES, 0)


@pytest.mark.parametrize(("kind", "make", "message"), MISTAKES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value", "ignore:overflow")
def test_a_mistake_is_named_on_one_line(kind, make, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        check(kind, make())
    assert "\n" not in str(caught.value)
