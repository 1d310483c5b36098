"""pdvol: progressing level-of-detail animation of volumetric elastodynamics, with contact that never interpenetrates.

Names load what they need when they are first used: describing a scene imports no solver, reading a run imports no
finite elements. `__init__.pyi` lists them, for Python and for type checkers.
"""

import lazy_loader

__version__ = "0.3.0"

__getattr__, _public, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __dir__() -> list[str]:
    return [*_public(), "__version__", "__doc__", "__file__", "__name__", "__path__"]
