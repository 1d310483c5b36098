"""Expressions of x, y, z and t in the grammar of PolyFEM's parser, tinyexpr: a sign binds more tightly than a power,
and powers are taken from left to right. Nothing is executed but arithmetic and the functions below.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError

MOST_TOKENS, MOST_NESTED = 2000, 40  # bounds on one expression
_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)|([A-Za-z_]\w*)|([-+*/%^(),]))")
_VARIABLES = ("x", "y", "z", "t")
_OPERATORS: tuple[dict[str, Callable[[Any, Any], Any]], ...] = (
    {"+": np.add, "-": np.subtract},
    {"*": np.multiply, "/": np.divide, "%": np.fmod},
    {"^": lambda a, b: np.power(np.asarray(a, dtype=float), b)},
)
_CONSTANTS = {"pi": np.pi, "e": np.e}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    **{name: (1, getattr(np, name)) for name in ("cos", "cosh", "exp", "floor", "ceil", "sin", "sinh", "sqrt")},
    **{name: (1, getattr(np, name)) for name in ("abs", "tan", "tanh", "log10", "sign", "deg2rad")},
    "acos": (1, np.arccos),
    "asin": (1, np.arcsin),
    "atan": (1, np.arctan),
    "ln": (1, np.log),
    "atan2": (2, np.arctan2),
    "pow": (2, np.power),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "compare": (2, lambda a, b: np.where(a < b, 1.0, 0.0)),
    "smooth_abs": (2, lambda x, k: np.tanh(k * x) * x),
    "if": (3, lambda check, then, other: np.where(check >= 0.0, then, other)),
    "rotate_2D_x": (3, lambda x, y, angle: x * np.cos(angle) - y * np.sin(angle)),
    "rotate_2D_y": (3, lambda x, y, angle: x * np.sin(angle) + y * np.cos(angle)),
}


@dataclass(frozen=True)
class Expression:
    """One expression, by its tokens; they have been read once, so that later evaluations cannot fail."""

    tokens: tuple[str, ...]

    @classmethod
    def read(cls, value: Any) -> "Expression":
        """Of a number or a text. Raises InputError, which says what is not understood."""
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise InputError("only numbers and expressions of x, y, z and t are understood here")
        made = cls(_tokens(value if isinstance(value, str) else f"({value!r})"))
        made(np.zeros((1, 3)), 0.0)
        return made

    @property
    def variables(self) -> set[str]:
        """Those of x, y, z and t that it uses."""
        return set(self.tokens) & set(_VARIABLES)

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        """(n,) its values at points (n, d) and a time."""
        columns = [X[:, k] if k < X.shape[1] else np.zeros(len(X)) for k in range(3)]
        parser = _Parser(self.tokens, dict(zip(_VARIABLES, [*columns, np.float64(t)], strict=True)))
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(parser.whole(), dtype=float), (len(X),)).copy()


def _tokens(text: str) -> tuple[str, ...]:
    found: list[str] = []
    place, text = 0, text.rstrip()
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None or len(found) == MOST_TOKENS:
            raise InputError(f"the expression {text[:60]!r} is not understood from {text[place : place + 10]!r} on")
        found.append(match.group().strip())
        place = match.end()
    return tuple(found)


class _Parser:
    """Recursive descent that evaluates as it goes."""

    def __init__(self, tokens: Sequence[str], variables: dict[str, Any]):
        self._tokens, self._place, self._nested, self._variables = tokens, 0, 0, variables

    def whole(self) -> Any:
        value = self._binary()
        if self._next:
            raise InputError(f"the expression is not understood at {self._next!r}")
        return value

    @property
    def _next(self) -> str:
        return self._tokens[self._place] if self._place < len(self._tokens) else ""

    def _take(self, wanted: str = "") -> str:
        found = self._next
        if not found or (wanted and found != wanted):
            raise InputError(f"the expression lacks {wanted or 'a value'!r} at {found or 'its end'!r}")
        self._place += 1
        return found

    def _binary(self, level: int = 0) -> Any:
        """A chain of operators that bind as tightly as those of a row of `_OPERATORS`, from left to right."""
        if level == len(_OPERATORS):
            return self._signed()
        value = self._binary(level + 1)
        while self._next in _OPERATORS[level]:
            operator = _OPERATORS[level][self._take()]
            value = operator(value, self._binary(level + 1))
        return value

    def _signed(self) -> Any:
        sign = 1.0
        while self._next in ("+", "-"):
            sign = -sign if self._take() == "-" else sign
        return sign * self._atom()

    def _atom(self) -> Any:
        word = self._take()
        if word == "(":
            return self._within(1)[0]
        if word[0].isdigit() or word[0] == ".":
            return np.float64(word)
        if word in self._variables:
            return self._variables[word]
        if word in _CONSTANTS:
            return _CONSTANTS[word]
        if word in _FUNCTIONS:
            count, function = _FUNCTIONS[word]
            self._take("(")
            return function(*self._within(count))
        raise InputError(f"the expression has {word!r}, which is no variable or function that pdvol knows")

    def _within(self, count: int) -> list[Any]:
        """The values between a bracket, which is taken, and the one that closes it."""
        self._nested += 1
        if self._nested > MOST_NESTED:
            raise InputError(f"the expression nests more than {MOST_NESTED} brackets")
        values = [self._binary()]
        for _ in range(count - 1):
            self._take(",")
            values.append(self._binary())
        self._take(")")
        self._nested -= 1
        return values
