"""Collision detection of pairs that slide: its steps end at the true time, however small gaps are beside the slide.

Truth is the distance on the way, by ipctk, which is independent of pdvol's code.
"""

import ipctk
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pdvol.compiled import ffi, pointer
from pdvol.geometry.rigid_motions import best_rotations
from pdvol.native import library
from pdvol.potentials.contact.surface import Primitives
from pdvol.potentials.potential import LEAST_LEFT

DHAT = 1e-3  # m: primitives are 0.1 to 1 m large
LEAST = 1e-3  # of dhat: what steps leave of a gap that begins above it
# m: distances of coordinates of up to 2 m are known to this; the smallest gaps here are 1e-15 m
ROUND_OFF = 4e-15

powers = lambda low, high: st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def slides(draw):
    """Two primitives at a gap of 1e-12 to 1 dhat, that slide by 1 to 1e6 gaps past each other, and approach by up to
    thrice their gap or leave, and turn; and whether they are edges. (6, 3) positions [m] at both ends of the way.
    """
    edges, random = draw(st.booleans()), np.random.default_rng(draw(st.integers(0, 10**6)))
    gap = DHAT * draw(powers(-12.0, 0.0))
    slide = min(gap * draw(powers(0.0, 6.0)), 0.3)
    approach = gap * draw(st.sampled_from([0.0, 0.5, 0.95, 1.5, 3.0, -1.0]))
    lower = 0.5 * np.append(random.standard_normal((3, 2)), np.zeros((3, 1)), axis=1)
    if edges:
        upper = np.array([0.5, -0.5])[:, None] * np.append(random.standard_normal(2), 0.0)
        upper[:, 2] += random.uniform(-0.2, 0.2) * np.array([1.0, -1.0]) * draw(st.sampled_from([0.0, 1.0]))
        lower = lower[:2] - lower[:2].mean(axis=0)
        normal = np.cross(upper[1] - upper[0], lower[1] - lower[0])
        if np.linalg.norm(normal) < 0.05:
            lower = lower[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
            normal = np.cross(upper[1] - upper[0], lower[1] - lower[0])
        normal /= np.linalg.norm(normal)
    else:
        lower[:, 1] *= draw(powers(-5.0, 0.0))  # flat triangles, too
        normal, upper = np.array([0.0, 0.0, 1.0]), (random.dirichlet([1.0, 1.0, 1.0]) @ lower)[None]
    along = np.cross(normal, random.standard_normal(3))
    along /= np.linalg.norm(along)
    start = np.concatenate([upper + gap * normal, lower])
    end = start.copy()
    end[: len(upper)] += slide * along - approach * normal
    turn = best_rotations(
        np.eye(3)[None] + draw(st.sampled_from([0.0, 0.1])) * slide * random.standard_normal((1, 3, 3))
    )
    return start, end @ turn[0].T, edges


def step_of(start: np.ndarray, end: np.ndarray, edges: bool) -> float:
    """pdvol's step for a pair, in which edges are sides of triangles."""
    count = 2 if edges else 1
    more = start.mean(axis=0) + [[3.0, 0.0, 5.0], [0.0, 3.0, 5.0]]  # third corners, far away
    x = np.concatenate([start, more])
    y = np.concatenate([end, more])
    first = [0, 1, len(start)] if edges else [0, len(start), len(start) + 1]
    second = [2, 3, len(start) + 1] if edges else [1, 2, 3]
    facets = np.array([first, second])
    objects = np.zeros(len(x), dtype=int)
    objects[second] = 1
    order = np.argsort(objects, kind="stable")
    facets = np.argsort(order)[facets]
    x, y = (np.ascontiguousarray(place[order]) for place in (x, y))
    surface = Primitives(x, facets, objects[order], 2, np.zeros(2, dtype=bool), np.ones(len(x), dtype=np.int8))
    if edges:
        lines = [sorted(facet[:2]) for facet in facets.tolist()]
        pair = [surface.edges.tolist().index(line) for line in lines]
    else:
        pair = [int(facets[0, 0]), 1]
    alone = ffi.new("pairs_t *", {"n_points": count % 2, "n_edges": count // 2})
    kept = np.array([pair], dtype=np.int32)
    alone.points = alone.edges = pointer(kept, "int32_t")
    return library[surface.d].longest_step(surface.c, pointer(x), pointer(y), DHAT, LEAST_LEFT, alone, 1.0)


def distance_of(place: np.ndarray, edges: bool) -> float:
    of = ipctk.edge_edge_distance if edges else ipctk.point_triangle_distance
    return float(np.sqrt(of(*place)))


@settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(slides())
def test_a_slide_ends_at_its_true_time(case):
    """Where the gap is what is kept: it is no less on the way, and no more at an end that comes early, so a
    slide along a face is free.
    """
    start, end, edges = case
    gap, least = distance_of(start, edges), LEAST * DHAT
    kept = LEAST_LEFT * min(gap, DHAT)
    kept = least if kept < least < gap / 1.001 else kept
    step = step_of(start, end, edges)
    for share in np.linspace(0.0, step, 100):
        assert distance_of(start + share * (end - start), edges) >= (1.0 - 1e-6) * kept - ROUND_OFF
    if step < 1.0 and kept >= 10.0 * ROUND_OFF:  # below, a difference of positions has no more digits
        assert distance_of(start + step * (end - start), edges) <= 1.01 * kept + ROUND_OFF
