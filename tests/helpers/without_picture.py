"""`python without_picture.py WORDS ...` is `pdvol WORDS ...` without the picture that ends a run."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

NAME = "pdvol.studio.draw.picture"


class UndrawnPicture(ModuleType):
    """Stands for the module that draws, which loads the plotting library."""

    def render(self, run: object, path: Path) -> Path:
        return path

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        del sys.modules[NAME]
        drawing = import_module(NAME)
        sys.modules[NAME] = self
        return getattr(drawing, name)


if __name__ == "__main__":
    sys.modules[NAME] = UndrawnPicture(NAME)
    import pdvol

    pdvol.main()
