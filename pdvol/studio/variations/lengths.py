"""Lengths as people read them."""


def length(metres: float | None) -> str:
    """A length for people: 5 mm, 0.31 mm, 1.2 m."""
    if metres is None:
        return "an unknown distance"
    for unit, factor in (("m", 1.0), ("cm", 1e2), ("mm", 1e3), ("um", 1e6)):
        if metres * factor >= 1.0 or unit == "um":
            return f"{metres * factor:.2g} {unit}" if metres * factor < 99.5 else f"{metres * factor:.0f} {unit}"
    raise AssertionError
