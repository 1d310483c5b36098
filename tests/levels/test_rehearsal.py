"""Each function of a scene is called before anything is meshed, and its mistake is named."""

import numpy as np
import pytest

import pdvol
from pdvol import meshes
from pdvol.errors import InputError
from pdvol.runs import preparation
from pdvol.runs.preflight import check_scene

BALL = meshes.ball(0.5, 1)
MISTAKES = {
    "body 'ball': velocity": lambda f: {"velocity": f},
    "the start of body 'ball'": lambda f: {"start": f},
    "NeoHookean.poisson": lambda f: {"material": pdvol.NeoHookean(1e5, f)},
    "NeoHookean.young": lambda f: {"regions": (pdvol.Region(pdvol.NeoHookean(f), lambda X: X[:, 0] > 0),)},
    "Region.where": lambda f: {"regions": (pdvol.Region(pdvol.NeoHookean(1e5), f),)},
    "a support's `where`": lambda f: {"supports": (pdvol.Support(f),)},
    "a support of all bodies, level 0: its motion": lambda f: {
        "supports": (pdvol.Support(lambda X: X[:, 0] > 0, motion=lambda X, t: f(X)),)
    },
    "plane 'plane': its motion": lambda f: {
        "obstacles": (pdvol.Plane((0, 0, -9), (0, 0, 1), name="plane", motion=lambda X, t: f(X)),),
        "contact": (pdvol.Barrier(),),
    },
    "gravity": lambda f: {"loads": (pdvol.Gravity(lambda t: f(t)),)},
    "Force.force": lambda f: {"loads": (pdvol.Force(lambda t: f(t)),)},
    "a force's `where`": lambda f: {"loads": (pdvol.Force((0, 0, 1), f),)},
    "PointForce.force": lambda f: {"loads": (pdvol.PointForce(lambda t: f(t), (0, 0, 0)),)},
    "Flow.velocity": lambda f: {"loads": (pdvol.Flow(lambda x, t: f(x)),)},
    "Pressure.pressure": lambda f: {"loads": (pdvol.Pressure("ball", lambda t: f(t)),)},
    "Muscle.where": lambda f: {"muscles": (pdvol.Muscle("ball", (1, 0, 0), 1e4, 1.0, f),)},
    "Muscle.fibre": lambda f: {"muscles": (pdvol.Muscle("ball", f, 1e4, 1.0, lambda X: X[:, 0] > 0),)},
    "Muscle.activation": lambda f: {"muscles": (pdvol.Muscle("ball", (1, 0, 0), 1e4, f, lambda X: X[:, 0] > 0),)},
    "Attachment.where": lambda f: {"attachments": (pdvol.Attachment("ball", "other", f),)},
    "Attachment.to": lambda f: {"attachments": (pdvol.Attachment("ball", "other", (0, 0, 0), f),)},
}
OF_BODY = {"velocity", "start", "material", "regions"}


def scene(parts):
    body = {"shape": BALL, "material": pdvol.NeoHookean(1e5), "vertices": (60, 200), "name": "ball"}
    body |= {name: value for name, value in parts.items() if name in OF_BODY}
    other = pdvol.Body(BALL, pdvol.NeoHookean(1e5), (60, 200), name="other", placement=pdvol.Placement((2.0, 0.0, 0.0)))
    rest = {name: value for name, value in parts.items() if name not in OF_BODY}
    return pdvol.Scene((pdvol.Body(**body), other), dt=0.01, steps=4, **rest)


def broken(_):
    raise KeyError("arm")


@pytest.mark.parametrize("named", MISTAKES)
def test_a_function_that_fails_is_named_before_anything_is_meshed(monkeypatch, named):
    monkeypatch.setattr(preparation, "build_apart", None)
    shot = scene(MISTAKES[named](broken))
    with pytest.raises(InputError) as caught:
        preparation.prepared_levels(shot, 1)
    assert str(caught.value).startswith(named) and "KeyError" in str(caught.value)
    assert check_scene(shot, 0.0)["defects"] == [f"defect: {caught.value}"]


def test_what_a_function_gives_at_the_shape_s_points_alone_is_no_mistake(monkeypatch):
    """A Young's modulus may vanish at the surface, where no centre of a cell is, and a `where` may choose no corner."""

    def meshed(*_):
        raise InputError("meshing")

    monkeypatch.setattr(preparation, "build_apart", meshed)
    shot = scene(
        {
            "material": pdvol.NeoHookean(lambda X: 0.25 - np.sum(X**2, axis=1)),
            "supports": (pdvol.Support(lambda X: np.sum(X**2, axis=1) < 0.01),),
            "muscles": (pdvol.Muscle("ball", lambda X: X / 0.0, 1e4, 1.0, lambda X: X[:, 0] > 9.0),),
        }
    )
    with pytest.raises(InputError, match="meshing"):
        preparation.prepared_levels(shot, 1)
