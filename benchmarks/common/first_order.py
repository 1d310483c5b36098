"""The model of the paper, of the peers and of pdvol's first versions, for what is compared with them."""

from dataclasses import fields, replace

from pdvol import Scene

FIRST_ORDER = {"integrator": "implicit_euler", "elements": "linear", "feedback": 0.0}
"""Settings of a scene: implicit Euler, linear elements, no feedback."""


def first_order(scene: Scene) -> Scene:
    """The same scene with `FIRST_ORDER`; a setting that the imported pdvol does not have yet is left out."""
    known = {field.name for field in fields(scene)}
    return replace(scene, **{name: value for name, value in FIRST_ORDER.items() if name in known})
