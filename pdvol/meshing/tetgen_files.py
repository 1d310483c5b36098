"""Pairs of files NAME.node and NAME.ele, as TetGen and Triangle write them, in text."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pdvol.errors import MeshError

PAIR = (".node", ".ele")


def node_and_ele(path: Path) -> dict[str, np.ndarray]:
    """Points, cells by their corners and regions; either file of the pair may be named.

    Raises
    ------
    MeshError
        The other file is missing, or a file does not hold what it promises.
    """
    nodes, elements = path.with_suffix(PAIR[0]), path.with_suffix(PAIR[1])
    for file in (nodes, elements):
        if not file.is_file():
            raise MeshError(f"{path}: there is no {file.name} beside it; .node and .ele files are exported as a pair")
    header, rows = _table(nodes, path, columns=lambda h: 1 + h[1] + h[2] + h[3])
    dim = int(header[1])
    if dim not in (2, 3):
        raise MeshError(f"{path}: {nodes.name} has points of {dim} coordinates; export the mesh again")
    first = int(rows[0, 0])  # vertices are numbered from 0 or 1 on
    _, cells = _table(elements, path, columns=lambda h: 1 + h[1] + h[2])
    width = int(_header(elements, path)[1])
    if width not in {2: (3, 6), 3: (4, 10)}[dim]:
        raise MeshError(f"{path}: {elements.name} has cells of {width} nodes; export triangles or tetrahedra")
    labels = cells[:, 1 + width] if cells.shape[1] > 1 + width else np.zeros(len(cells))
    notes = [f"{len(cells):,} quadratic cells are read by their corners"] if width in (6, 10) else []
    return {
        "points": rows[:, 1 : 1 + dim],
        "cells": cells[:, 1 : 2 + dim].astype(np.int64) - first,
        "regions": np.round(labels).astype(np.int32),
        "notes": np.array(notes, dtype=str),
    }


def _numbers(file: Path) -> np.ndarray:
    return np.array(re.sub(r"#[^\n]*", "", file.read_text(encoding="utf-8-sig", errors="replace")).split(), dtype=float)


def _header(file: Path, path: Path) -> np.ndarray:
    """The counts (4,) of a file's first line, missing ones 0."""
    with file.open(encoding="utf-8-sig", errors="replace") as lines:
        words: list[str] = next((w for line in lines if (w := line.partition("#")[0].split())), [])
    header = np.array([int(word) for word in words[:4]] + [0] * (4 - len(words[:4])))
    if header.min() < 0 or header[0] == 0:
        raise MeshError(f"{path}: unreadable, {file.name} promises {header.min()} of something; export the mesh again")
    return header


def _table(file: Path, path: Path, columns: Callable[[np.ndarray], int]) -> tuple[np.ndarray, np.ndarray]:
    """A file's header and its rows of numbers."""
    header, numbers = _header(file, path), _numbers(file)
    with file.open(encoding="utf-8-sig", errors="replace") as lines:
        words = next(len(w) for line in lines if (w := line.partition("#")[0].split()))
    width, rest = int(columns(header)), numbers[words:]
    if len(rest) < header[0] * width:
        raise MeshError(
            f"{path}: truncated, {file.name} promises {header[0]:,} rows and holds {len(rest) // width:,};"
            " export the mesh again"
        )
    return header, rest[: header[0] * width].reshape(-1, width)
