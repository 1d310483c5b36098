"""The diagram of the house: which folder of pdvol imports which, drawn from the table that tests/structure enforces.

    ./run python docs/_site/house.py     # writes docs/pictures/house.svg

An arrow leads from a folder to one that may import it. Arrows that follow from others are left out.
"""

import ast
from pathlib import Path
from xml.sax.saxutils import escape

DOCS = Path(__file__).resolve().parents[1]
PICTURE = DOCS / "pictures" / "house.svg"
RULES = DOCS.parent / "tests" / "structure" / "test_house.py"

WORDS = {
    "forms": "energies in UFL",
    "meshes": "recipes of shapes",
    "geometry": "arrays in, arrays out",
    "meshing": "read, repair, mesh",
    "store": "a run folder",
    "levels": "a scene on a level",
    "measure": "metrics, checks",
    "potentials": "terms of the energy",
    "solve": "one minimisation",
    "integrate": "steps and marches",
    "runs": "one run, brought together",
    "studio.imports": "PolyFEM, animated meshes",
    "studio.draw": "pictures, films",
    "studio.export": "other formats",
    "studio.play": "a page of a run",
    "studio.wedge": "many runs of a scene",
    "studio.study": "speed against accuracy",
    "studio.live": "the live page",
    "commands": "the command line",
}
COLUMNS = {
    "forms": 0, "meshes": 1, "geometry": 2, "meshing": 1, "store": 3, "levels": 1, "measure": 2, "potentials": 1,
    "solve": 1, "integrate": 1, "runs": 2, "studio.imports": 0, "studio.draw": 3, "studio.export": 4, "studio.play": 5,
    "studio.wedge": 2, "studio.study": 3, "studio.live": 1, "commands": 2,
}  # fmt: skip
WIDTH, HEIGHT, ACROSS, DOWN = 176, 44, 196, 74
"""Size of a box, and the distances between boxes [pixels]."""
GROUND = "scene, registry, errors, parallel, processes, compiled, stages, compat: serve all folders from geometry on"
CORE, WING = ("#eef3fb", "#4a6fa5"), ("#fbf3e6", "#b98a3a")
"""Fill and rim of boxes: of the core and the command line, and of the studio."""


def rules() -> dict[str, set[str]]:
    """`MAY_IMPORT` of the tests, read without running them."""
    known: dict = {}
    for node in ast.parse(RULES.read_text()).body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        if getattr(target, "id", "") in ("STAGES", "STORED", "MAY_IMPORT"):
            code = compile(ast.Expression(node.value), str(RULES), "eval")
            known[target.id] = eval(code, {"set": set}, known)
    may = {folder: others - {"studio"} for folder, others in known["MAY_IMPORT"].items() if folder != "studio"}
    return {**may, "commands": set(may)}


def arrows(may: dict[str, set[str]]) -> list[tuple[str, str]]:
    """(imported, importing) pairs that do not follow from others."""
    below: dict[str, set[str]] = {}

    def all_below(folder: str) -> set[str]:
        if folder not in below:
            below[folder] = may[folder].union(*(all_below(other) for other in may[folder]))
        return below[folder]

    return sorted(
        (other, folder)
        for folder in may
        for other in may[folder]
        if not any(other in all_below(between) for between in may[folder] - {other})
    )


def rows(may: dict[str, set[str]]) -> dict[str, int]:
    """How many folders are below each one, in the longest chain."""
    found: dict[str, int] = {}

    def row(folder: str) -> int:
        if folder not in found:
            found[folder] = 1 + max((row(other) for other in may[folder]), default=-1)
        return found[folder]

    for folder in may:
        row(folder)
    return found


def drawn() -> str:
    """The diagram as SVG."""
    may = rules()
    row = rows(may)
    wide, high = max(COLUMNS.values()) * ACROSS + WIDTH + 40, max(row.values()) * DOWN + HEIGHT + 90
    place = {folder: (20 + ACROSS * COLUMNS[folder], 20 + DOWN * row[folder]) for folder in may}
    lines = []
    for start, end in arrows(may):
        (x0, y0), (x1, y1) = place[start], place[end]
        x0, y0, x1 = x0 + WIDTH / 2, y0 + HEIGHT, x1 + WIDTH / 2
        bend = min(30.0, (y1 - y0) / 2)
        way = f"M{x0:g},{y0:g} C{x0:g},{y0 + bend:g} {x1:g},{y1 - bend - 8:g} {x1:g},{y1 - 4:g}"
        if y1 - y0 > DOWN:  # past the rows between: straight down first
            way = f"M{x0:g},{y0:g} L{x0:g},{y1 - 38:g} C{x0:g},{y1 - 16:g} {x1:g},{y1 - 30:g} {x1:g},{y1 - 4:g}"
        lines.append(f'<path d="{way}" fill="none" stroke="#8a8f98" stroke-width="1.4" marker-end="url(#tip)"/>')
    for folder, (x, y) in place.items():
        fill, rim = WING if folder.startswith("studio.") else CORE
        lines.append(f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="6" fill="{fill}" stroke="{rim}"/>')
        middle, name = x + WIDTH / 2, folder.replace(".", "/")
        lines.append(f'<text x="{middle:g}" y="{y + 18}" font-weight="bold" font-size="14">{name}</text>')
        lines.append(f'<text x="{middle:g}" y="{y + 35}" font-size="12">{escape(WORDS[folder])}</text>')
    ground = f'<text x="{wide / 2:g}" y="{high - 20}" font-size="12" font-style="italic">{escape(GROUND)}</text>'
    tip = '<marker id="tip" markerWidth="8" markerHeight="8" refX="5" refY="3" orient="auto">'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}">',
            f'<defs>{tip}<path d="M0,0 L6,3 L0,6 z" fill="#8a8f98"/></marker></defs>',
            '<rect width="100%" height="100%" fill="white"/>',
            '<g font-family="sans-serif" text-anchor="middle" fill="#1d2733">',
            *lines,
            ground,
            "</g>",
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(drawn())
    print(PICTURE)
