"""What points of cost and error say: the front, fitted orders, the choice for a wanted accuracy, candidates to try."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

HIGHEST_ORDER = 6.0  # of a fit: differences that fall faster are round-off of the finest value
LEAST_DIFFERENCES = 3  # of a fit of an order and a constant: two always fit
GAIN = 1.1  # a candidate must promise an error that many times below the front's to be worth a run


def on_front(costs: Sequence[float], errors: Sequence[float]) -> list[bool]:
    """Which points no other one beats in both cost and error."""
    return [
        not any((c <= cost and e <= error) and (c < cost or e < error) for c, e in zip(costs, errors, strict=True))
        for cost, error in zip(costs, errors, strict=True)
    ]


def fitted_order(values: Sequence[float], differences: Sequence[float], finest: float) -> float | None:
    """The order p of errors C h^p, from differences C |h^p - f^p| to the result at the finest value f.

    Parameters
    ----------
    values : h, none of them f
    differences : of their results to the one at f, above zero

    Returns
    -------
    float or None
        The least-squares fit of the logarithms; None where it runs into its bounds, so that no order is seen, and for
        fewer than three values, through which some order always fits.
    """
    h, d = np.asarray(values, dtype=float) / finest, np.asarray(differences, dtype=float)
    if len(h) < LEAST_DIFFERENCES or (d <= 0.0).any():
        return None

    def misfit(order: float) -> float:
        residual = np.log(d) - np.log(abs(h**order - 1.0))
        return float(((residual - residual.mean()) ** 2).sum())

    found = minimize_scalar(misfit, bounds=(0.05, HIGHEST_ORDER), method="bounded", options={"xatol": 1e-6})
    return float(found.x) if 0.06 < found.x < HIGHEST_ORDER - 0.01 else None


def richardson(difference: float, ratio: float, order: float) -> float:
    """The error at the finer of two values, `ratio` times apart, whose results differ by `difference`."""
    return difference / (ratio**order - 1.0)


def cheapest_within(points: Sequence[Mapping], accuracy: float, own_error: float) -> Mapping | None:
    """The cheapest point whose error and the reference's own one together are at most `accuracy` [m]."""
    fit = [point for point in points if point["errors"]["end"] + own_error <= accuracy and point["errors"]["outcome"]]
    return min(fit, key=lambda point: point["cost"]["cpu"], default=None)


def most_accurate_within(points: Sequence[Mapping], seconds: float) -> Mapping | None:
    """The point of the smallest error that costs at most `seconds` of CPU time."""
    fit = [point for point in points if point["cost"]["cpu"] <= seconds]
    return min(fit, key=lambda point: (not point["errors"]["outcome"], point["errors"]["end"]), default=None)


def candidates(
    base: tuple[float, float],
    axes: Mapping[str, Mapping[Any, tuple[float, float]]],
    measured: Sequence[tuple[float, float]],
) -> list[tuple[float, dict[str, Any]]]:
    """Combinations of changes that promise to lie below the front that is measured, the most promising first.

    Costs are expected to multiply, and squared errors to add: each change adds what it added to the base alone.

    Parameters
    ----------
    base : (cost, error) of the scene's own settings
    axes : by name and value, (cost, error) with this one change
    measured : (cost, error) of all points there are

    Returns
    -------
    list of (expected cost, changes)
    """
    cost0, error0 = base
    least = 0.25 * min(error for _, error in measured)
    found: list[tuple[float, float, float, dict[str, Any]]] = []
    names = list(axes)
    for choice in itertools.product(*([None, *axes[name]] for name in names)):
        changes = {name: value for name, value in zip(names, choice, strict=True) if value is not None}
        if len(changes) < 2:
            continue
        alone = [axes[name][value] for name, value in changes.items()]
        cost = cost0 * float(np.prod([c / cost0 for c, _ in alone]))
        squared = error0**2 + sum(e**2 - error0**2 for _, e in alone)
        error = max(np.sqrt(max(squared, 0.0)), least)
        front = min((e for c, e in measured if c <= cost), default=np.inf)
        gain = front / error if np.isfinite(front) else np.inf
        if gain >= GAIN:
            found.append((gain, cost, error, changes))
    chosen = on_front([c for _, c, _, _ in found], [e for _, _, e, _ in found])
    best = [entry for entry, kept in zip(found, chosen, strict=True) if kept]
    return [(cost, changes) for _, cost, _, changes in sorted(best, key=lambda entry: (entry[1], -entry[0]))]
