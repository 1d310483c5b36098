"""Links from a page to a file outside docs/ lead to a page of the site that shows it; those to a folder, to its list.

On a code host the same link opens the file itself.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.transforms import SphinxTransform

PAGES = "source"  # their folder in the site


class SourceLinks(SphinxTransform):
    """Before Sphinx makes downloads of linked files."""

    default_priority = 5

    def apply(self, **kwargs: Any) -> None:
        docs = Path(self.env.srcdir)
        links = addnodes.download_reference | addnodes.pending_xref
        for node in list(self.document.findall(lambda node: isinstance(node, links))):
            target = node.get("reftarget", "").partition("#")[0]
            path = (docs / self.env.docname).parent / target
            if not path.exists():
                path = path.with_name(f"{path.name}.md")  # MyST takes the ending off
            if not target or not path.exists() or path.resolve().is_relative_to(docs):
                continue
            place = path.resolve().relative_to(docs.parent).as_posix()
            shown = self.env.__dict__.setdefault("pdvol_sources", set())
            shown.add(place)
            up = "../" * self.env.docname.count("/")
            link = nodes.reference("", "", *(child.deepcopy() for child in node.children), internal=True)
            link["refuri"] = f"{up}{PAGES}/{place}.html"
            node.replace_self(link)


def pages(app: Any) -> Iterator[tuple[str, dict, str]]:
    """One page for each file or folder that a page links to."""
    root = Path(app.srcdir).parent
    for place in sorted(app.env.__dict__.get("pdvol_sources", ())):
        path = root / place
        if path.is_dir():
            files = sorted(p.name for p in path.iterdir() if p.name[0] not in "._")
            body = "<ul>" + "".join(f"<li><code>{name}</code></li>" for name in files) + "</ul>"
        else:
            try:
                lexer = get_lexer_for_filename(path.name)
            except ClassNotFound:
                lexer = TextLexer()
            body = highlight(path.read_text(), lexer, HtmlFormatter(nowrap=False))
        yield f"{PAGES}/{place}", {"title": place, "body": f"<h1>{place}</h1>{body}", "metatags": ""}, "page.html"


def setup(app: Any) -> dict:
    app.add_transform(SourceLinks)
    app.connect("html-collect-pages", pages)
    return {"parallel_read_safe": False}
