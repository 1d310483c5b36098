"""A march of any scene on several ranks; scenes have functions of their own, which cloudpickle carries over."""

import cloudpickle
import numpy as np

import pdvol


def marched(comm, sent: bytes) -> dict[str, np.ndarray]:
    """The states by level and step."""
    scene, how = cloudpickle.loads(sent)
    return {f"{step.level} {step.step}": step.positions for step in pdvol.march(scene, comm=comm, **how)}
