"""A user's Python files as modules, a scene file with those that lie beside it.

Each file that is loaded has modules of its own, read anew: those beside one scene may have the names of those beside
another, and an edit of one counts. As with every module of Python, `sys.modules` has them; it has those of the file
whose code was loaded, or imports, last.
"""

import builtins
import os
import sys
from importlib import machinery
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from pdvol.errors import InputError, PdvolError
from pdvol.processes import Beside
from pdvol.runs.known_scenes import allow


class _Folder:
    """The modules beside one loaded file; `trusted` where files that have not run here may run."""

    current: "_Folder"

    def __init__(self, path: Path, trusted: bool):
        self.path, self.trusted = str(path), trusted
        self._before = set[str]()
        self._added = False
        self._modules: dict[str, ModuleType] = {}

    def enter(self) -> None:
        """Let `import` find the modules of this folder, after all others, instead of those of another one."""
        if _Folder.current is self:
            return
        _Folder.current._leave()
        _Folder.current = self
        self._before = self._before or set(sys.modules)
        self._added = self.path not in sys.path
        sys.path += [Beside(self.path)] * self._added
        sys.path_importer_cache.pop(self.path, None)
        sys.modules.update(self._modules)

    def _leave(self) -> None:
        if self._added and self.path in sys.path:
            sys.path.remove(self.path)
        names = [name for name in list(sys.modules) if name not in self._before and self._holds(sys.modules[name])]
        self._modules = {name: sys.modules.pop(name) for name in names}

    def _holds(self, module: Any) -> bool:
        spec = getattr(module, "__spec__", None)
        if spec is None or isinstance(spec.loader, machinery.ExtensionFileLoader):  # which cannot be loaded twice
            return False
        places = [spec.origin, *(spec.submodule_search_locations or ())]
        return any(str(place).startswith(self.path + os.sep) for place in places)


class _Compiled(machinery.SourceFileLoader):
    """Compiles a file each time, as Python's cache misses a quick edit; later imports are from its own folder, too."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)

    def exec_module(self, module: ModuleType) -> None:
        folder = _Folder.current

        def import_(*words: Any, **named: Any) -> ModuleType:
            folder.enter()
            return builtins.__import__(*words, **named)

        module.__dict__["__builtins__"] = {**vars(builtins), "__import__": import_}
        super().exec_module(module)


class _Finder(machinery.FileFinder):
    """Finds the modules beside a loaded file, as Python does, but for one that has not run here where it must have."""

    def find_spec(self, fullname: str, target: ModuleType | None = None) -> machinery.ModuleSpec | None:
        spec = super().find_spec(fullname, target)
        if spec is not None and spec.origin is not None:
            allow(Path(spec.origin), trusted=_Folder.current.trusted)
        return spec


def _finder(path: str) -> _Finder:
    """That of the current folder and those within it, for `sys.path_hooks`."""
    if not (f"{path}{os.sep}".startswith(_Folder.current.path + os.sep) and os.path.isdir(path)):
        raise ImportError("this is no folder of a scene")
    extensions = machinery.ExtensionFileLoader, machinery.EXTENSION_SUFFIXES
    compiled = machinery.SourcelessFileLoader, machinery.BYTECODE_SUFFIXES
    return _Finder(path, extensions, (_Compiled, machinery.SOURCE_SUFFIXES), compiled)


_Folder.current = _Folder(Path("none"), trusted=True)  # nothing lies there: paths are absolute
sys.path_hooks.insert(0, _finder)


def load_module(file: Path, trusted: bool = True) -> ModuleType:
    """A scene file, or another Python file of the user's, as a module, which may import those beside it.

    Parameters
    ----------
    trusted : whether it may run if it has not run here before, as one that the user names

    Raises
    ------
    InputError
        It cannot be read, or must not run.
    """
    if not file.is_file():
        raise InputError(f"there is no scene file {file}")
    name = f"pdvol_scene_{file.stem}"
    spec = spec_from_file_location(name, file, loader=_Compiled(name, str(file)))
    if file.suffix not in machinery.SOURCE_SUFFIXES or spec is None or spec.loader is None:
        raise InputError(f"{file} is not a Python file; a scene file defines scene(**parameters)")
    allow(file, trusted=trusted)
    _Folder(file.resolve().parent, trusted).enter()
    module = sys.modules[name] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        sys.modules.pop(name, None)
        if isinstance(error, PdvolError) or not isinstance(error, Exception | SystemExit):
            raise
        raise InputError(f"{file} could not be read: {error_text(error)}") from error
    return module


def error_text(error: BaseException) -> str:
    """A user's exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
