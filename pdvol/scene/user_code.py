"""What a user's callable consists of: its text, and what it reads when it is called."""

import functools
import inspect
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

PACKAGES = ("site-packages", "dist-packages")
"""Folders of installed packages, whose code counts as unchanging."""
STANDARD = sysconfig.get_paths()["stdlib"]
PDVOL = Path(__file__).resolve().parents[1]


def name_of(thing: Any) -> str:
    """The name of a callable, or that of its class."""
    return getattr(thing, "__qualname__", type(thing).__name__)


def is_library(thing: Any) -> bool:
    """Whether a module, function, class or object belongs to Python, to an installed package or to pdvol."""
    file = _file(thing)
    if file is None:
        return True  # of C
    path = Path(file)
    if not path.is_absolute():
        return False  # typed in
    here = path.resolve()
    return bool(set(PACKAGES) & set(here.parts)) or here.is_relative_to(STANDARD) or here.is_relative_to(PDVOL)


def text_of(thing: Any) -> str:
    """The source of a function; that of its functions for a class, and the file's for a module."""
    if isinstance(thing, ModuleType):
        return Path(str(thing.__file__)).read_text(encoding="utf-8", errors="replace")
    if isinstance(thing, type):
        return "\n".join(text_of(function) for function in _functions(thing))
    if isinstance(thing, FunctionType | MethodType):
        try:
            return inspect.getsource(thing)
        except (OSError, TypeError):
            return _bytes(thing.__code__)
    return ""


def reads_of(thing: Any) -> dict[str, Any]:
    """What a callable, class or module reads besides its own text, by name: globals of the user's, what it closes over,
    what it is bound to, and the attributes of an object. Installed packages are left out.
    """
    if isinstance(thing, functools.partial):
        return {"function": thing.func, "arguments": thing.args, **thing.keywords}
    if isinstance(thing, MethodType):
        return {"self": thing.__self__, **reads_of(thing.__func__)}
    if isinstance(thing, FunctionType):
        return dict(_read(thing))
    if isinstance(thing, type):
        return {name: value for function in _functions(thing) for name, value in _read(function)}
    if isinstance(thing, ModuleType):
        return {n: v for n, v in vars(thing).items() if isinstance(v, ModuleType) and not is_library(v)}
    own = {} if is_library(type(thing)) else {"class": type(thing)}
    slots = [name for base in type(thing).__mro__ for name in getattr(base, "__slots__", ()) if hasattr(thing, name)]
    return {**own, **{name: getattr(thing, name) for name in slots}, **getattr(thing, "__dict__", {})}


def can_be_compared(thing: Any) -> bool:
    """Whether anything of an object says what it does: a function, or an object with attributes or a class of the
    user's.
    """
    known = isinstance(thing, functools.partial | FunctionType | MethodType | type | ModuleType)
    return known or hasattr(thing, "__dict__") or not is_library(type(thing)) or " at 0x" not in repr(thing)


def _file(thing: Any) -> str | None:
    if isinstance(thing, ModuleType):
        return getattr(thing, "__file__", None)
    if isinstance(thing, MethodType):
        thing = thing.__func__
    if isinstance(thing, FunctionType):
        return thing.__code__.co_filename
    if isinstance(thing, type):
        return next((function.__code__.co_filename for function in _functions(thing)), None)
    return _file(type(thing))


def _functions(cls: type) -> Iterator[FunctionType]:
    """The functions of a class and of those of the user's that it derives from."""
    for base in cls.__mro__:
        for value in vars(base).values():
            function = getattr(value, "__func__", getattr(value, "fget", value))
            if isinstance(function, FunctionType) and (base is cls or not is_library(function)):
                yield function


def _read(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Globals of the user's that a function names, also within functions of its own."""
    for name in sorted(_names(function.__code__)):
        if name not in function.__globals__:
            continue
        value = function.__globals__[name]
        if not (isinstance(value, ModuleType | type | FunctionType | BuiltinFunctionType) and is_library(value)):
            yield name, value


def _names(code: CodeType) -> set[str]:
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*inner)


def _bytes(code: CodeType) -> str:
    """A function without a source, as one that was typed in."""
    constants = [_bytes(value) if isinstance(value, CodeType) else repr(value) for value in code.co_consts]
    return f"{code.co_code.hex()}{constants}{code.co_names}"
