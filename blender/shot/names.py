"""Names of files and parameters for objects, whose own names may hold anything."""

import re
from collections.abc import Sequence

LONGEST = 40  # characters that are kept: pdvol's exports have a limit, too, for the name with what follows it
GROUND = "ground"
"""The name of the scene's plane, which no object has."""
CLOSE_HOLES = "Close holes"
WIDEST_HOLE = "Widest hole"
"""The setting of a body that simulates a closed copy of its mesh, as the panel shows it."""


def plain_names(labels: Sequence[str]) -> list[str]:
    """Names of letters, digits and underscores in the same order, no two alike on any file system, none of which begins
    with a digit or ends as those do that pdvol gives to render meshes.
    """
    taken, names = {GROUND}, []
    for label in labels:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", label)[:LONGEST] or "body"
        plain = plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
        plain = f"{plain}_mesh" if plain.lower().endswith("_render") else plain
        free, number = plain, 1
        while free.lower() in taken:
            number += 1
            free = f"{plain}_{number}"
        taken.add(free.lower())
        names.append(free)
    return names
