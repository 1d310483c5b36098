"""What the dataclasses of a scene have in common: checked fields, and a repr of one line."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from pdvol.scene.checks import Check, plain

MOST_ITEMS = 4  # of a tuple: of a longer one the first two, the last one and the number are shown
MOST_TEXT = 80  # characters of one value
NOT_SIMULATED = "not simulated"  # key of a field's metadata: two scenes that differ there have the same states


_beside: ContextVar[Path | None] = ContextVar("beside", default=None)


@contextmanager
def files_beside(file: Path) -> Iterator[None]:
    """Within it, elements look for their files beside this one, then in the working folder."""
    token = _beside.set(file.resolve().parent)
    try:
        yield
    finally:
        _beside.reset(token)


def located(value: Any) -> Any:
    """A path, or those of a tuple, where `files_beside` finds the file; beside where none is. All else as it is."""
    folder = _beside.get()
    if isinstance(value, tuple | list):
        return type(value)(map(located, value)) if any(isinstance(one, str | Path) for one in value) else value
    if folder in (None, Path.cwd()) or not isinstance(value, str | Path) or not str(value):
        return value
    path = cast(Path, folder) / Path(value).expanduser()
    return value if Path(value).expanduser().exists() and not path.exists() else type(value)(path)


def one_line(element: Any) -> str:
    """`Name(field=value, ...)` of a dataclass, without the fields that have their default; its `__repr__`."""
    shown = [f"{f.name}={_value(getattr(element, f.name))}" for f in fields(element) if not _is_default(element, f)]
    return f"{type(element).__name__}({', '.join(shown)})"


class Element:
    """A frozen dataclass of a scene. Each field that has a line in `checks` is kept `plain`, and checked. Those that
    `files` names may be paths.

    A class with more to check extends `__post_init__`.
    """

    checks: ClassVar[Mapping[str, Check]] = {}
    files: ClassVar[tuple[str, ...]] = ()
    whose: ClassVar[str] = "{kind}."  # before the name of a field in messages
    __repr__ = one_line

    def __post_init__(self) -> None:
        for name in self.files:
            object.__setattr__(self, name, located(getattr(self, name)))
        for name, check in self.checks.items():
            object.__setattr__(self, name, plain(getattr(self, name)))
            check(self._named(name), getattr(self, name))

    def _named(self, field: str) -> str:
        """The name of a field in messages."""
        return self.whose.format(kind=type(self).__name__, name=getattr(self, "name", "")) + field


def _is_default(element: Any, field: Field) -> bool:
    value = getattr(element, field.name)
    default = field.default_factory() if field.default_factory is not MISSING else field.default
    return type(value) is type(default) and bool(value == default)


def _value(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}"
    if isinstance(value, (tuple, list)):
        # Parts of a scene go by their names where they have one.
        items = [_part(item) if is_dataclass(item) else _value(item) for item in value]
        if len(items) > MOST_ITEMS:
            return f"({items[0]}, {items[1]}, ..., {items[-1]}: {len(items)} in all)"
        return f"({', '.join(items)}{',' if len(items) == 1 else ''})"
    if callable(value) and not is_dataclass(value):
        return getattr(value, "__qualname__", type(value).__name__).rpartition("<locals>.")[2]
    text = " ".join(repr(value).split())
    return text if is_dataclass(value) or len(text) <= MOST_TEXT else f"{text[: MOST_TEXT - 3]}..."


def _part(part: Any) -> str:
    name = getattr(part, "name", None)
    return repr(name) if isinstance(name, str) else type(part).__name__
