"""What reading a file leaves out, in words."""

from collections.abc import Sequence

MOST_NAMED = 8  # things that a line names


def named(names: Sequence[str]) -> str:
    """The first of some names."""
    return ", ".join(names[:MOST_NAMED]) + (", ..." if len(names) > MOST_NAMED else "")


def counted(what: str, names: Sequence[str]) -> list[str]:
    """A line with the number of some things and their names; none where there is nothing."""
    return [f"{what}: {len(names):,} ({named(names)})"] if names else []
