"""Equations in LaTeX as MathML, which browsers draw themselves: no script and no font is needed."""

import re
from typing import Any

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

GREEK = re.compile(r"<mi>(&#x003[9A-C][0-9A-F];)</mi>")


def mathml(latex: str, display: str) -> str:
    """Greek letters are slanted by the style sheet: few fonts have the italic ones that browsers take for them."""
    return GREEK.sub(r'<mi mathvariant="normal" class="greek">\1</mi>', convert(latex, display=display))


def inline(writer: Any, node: Any) -> None:
    writer.body.append(mathml(node.astext(), "inline"))
    raise SkipNode


def block(writer: Any, node: Any) -> None:
    writer.body.append(f'<div class="math">{mathml(node.astext(), "block")}</div>')
    raise SkipNode


def setup(app: Any) -> dict:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
