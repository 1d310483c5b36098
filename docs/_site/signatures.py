"""Signatures of the Python reference, written into its pages so that a code host shows them, too.

./run python docs/_site/signatures.py    # writes docs/api anew; the tests compare

Before each block of directives stands a list with the call of each name and the first sentence of its docstring, and
the calls of its methods. Default values that are functions or objects are three dots.
"""

import importlib
import inspect
import re
from pathlib import Path
from typing import Any

API = Path(__file__).resolve().parents[1] / "api"
BLOCK = re.compile(r"(?:<!-- signatures -->\n.*?<!-- end -->\n\n)?(```\{eval-rst\}\n(.*?)```)", re.DOTALL)
DIRECTIVE = re.compile(r"^\.\. auto(class|function|exception):: (\S+)((?:\n   :.*)*)", re.MULTILINE)


def call(name: str, thing: Any) -> str:
    """`name(first, second=2)`: without annotations, which the docstring says in words."""
    shown = []
    for parameter in inspect.signature(thing).parameters.values():
        if parameter.name == "self":
            continue
        plain = parameter.replace(annotation=inspect.Parameter.empty)
        if parameter.default is not inspect.Parameter.empty and not is_plain(parameter.default):
            plain = plain.replace(default=inspect.Parameter.empty)
            shown.append(f"{plain}=...")
        else:
            shown.append(str(plain))
    return f"{name}({', '.join(shown)})"


def is_plain(value: Any) -> bool:
    """Whether a default value is shown as it is."""
    if isinstance(value, tuple):
        return all(is_plain(part) for part in value)
    return value is None or isinstance(value, bool | int | float | str)


def sentence(thing: Any) -> str:
    """The first sentence of a docstring, on one line, with formulas kept from being Markdown."""
    text = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    first = re.split(r"(?<=[.:])\s+(?=[A-Z`])", text)[0].rstrip(":")
    parts = re.split(r"(`[^`]+`)", first)
    return "".join(part if part.startswith("`") else re.sub(r"([*_|<>\[\]\\])", r"\\\1", part) for part in parts)


def named(path: str) -> Any:
    """What a dotted name stands for; a function goes before the module of its name."""
    parts = path.split(".")
    thing = importlib.import_module(parts[0])
    for number, part in enumerate(parts[1:], 2):
        if not hasattr(thing, part):
            importlib.import_module(".".join(parts[:number]))
        thing = getattr(thing, part)
    return thing


def lines(kind: str, name: str, options: str) -> list[str]:
    """The list's items for one directive: the name, and the public methods that the site shows."""
    thing, short = named(name), name.rpartition(".")[2]
    protocol = inspect.isclass(thing) and getattr(thing.__init__, "__module__", "") == "typing"
    shown = short if kind == "exception" or protocol else call(short, thing)
    members = []
    if kind == "class" and ":members:" in options:
        chosen = [word.strip() for word in options.partition(":members:")[2].split(",") if word.strip()]
        for member, value in vars(thing).items():
            value = value.__func__ if isinstance(value, classmethod | staticmethod) else value
            if (member in chosen or not chosen) and not member.startswith("_") and inspect.getdoc(value):
                if inspect.isfunction(value) and value.__name__ == member:
                    text = call(f".{member}", value).replace("(cls, ", "(").replace("(cls)", "()")
                    members.append(f"`{text}`")
                elif isinstance(value, property):
                    members.append(f"`.{member}`")
    return [f"- `{shown}`: {sentence(thing)}", *([f"  - {', '.join(members)}"] if members else [])]


def written(text: str) -> str:
    """A page with its signatures."""

    def block(found: re.Match) -> str:
        items = [
            line
            for directive in DIRECTIVE.findall(found[2])
            for line in lines(directive[0], directive[1], directive[2])
        ]
        return "\n".join(["<!-- signatures -->", *items, "<!-- end -->", "", found[1]])

    return BLOCK.sub(block, text)


if __name__ == "__main__":
    for page in sorted(API.glob("*.md")):
        page.write_text(written(page.read_text()))
