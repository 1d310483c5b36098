"""The distances of the compiled loops, of any place and direction, against a search and against another formula."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest

from contact_reference import to_facets, to_segment
from pdvol import native
from pdvol.compiled import FLAGS

PROGRAM = """
#include "surface.h"
void segments(int n, const double *a, const double *b, const double *c, const double *d, double *out)
{
    double s, t;
    for (int k = 0; k < n; ++k)
        out[k] = between_segments(a + 3 * k, b + 3 * k, c + 3 * k, d + 3 * k, &s, &t);
}
void triangles(int n, const double *p, const double *x, double *out)
{
    closest_t found;
    for (int k = 0; k < n; ++k) {
        const double *corners[3] = {x + 9 * k, x + 9 * k + 3, x + 9 * k + 6};
        out[k] = to_triangle(p + 3 * k, corners, &found);
    }
}
"""
COUNT = 2000


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Calls of the header's inline functions: distances from arrays."""
    folder = tmp_path_factory.mktemp("distances")
    (folder / "distances.c").write_text(PROGRAM)
    header = [f"-I{Path(native.__file__).parent}", "-DDIM=3"]
    built = str(folder / "distances.so")
    subprocess.run(
        ["cc", *FLAGS, *header, "-shared", "-fPIC", str(folder / "distances.c"), "-o", built, "-lm"], check=True
    )
    library = ctypes.CDLL(built)

    def call(name, *arrays):
        out = np.zeros(len(arrays[0]))
        kept = [np.ascontiguousarray(array) for array in (*arrays, out)]
        getattr(library, name)(len(out), *(array.ctypes.data_as(ctypes.c_void_p) for array in kept))
        return np.sqrt(kept[-1])

    return call


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-5, 1e-4, 2e-4, 1e-3, 1.0])
@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3])
def test_distances_of_segments(compiled, angle, length):
    """From parallel to across, at any place along each other, against a search along them."""
    rng = np.random.default_rng(3)
    a, c = rng.uniform(-1, 1, (2, COUNT, 3))
    e = length * rng.standard_normal((COUNT, 3))
    turned = e + angle * np.linalg.norm(e, axis=1)[:, None] * rng.standard_normal((COUNT, 3))
    b, d = a + e, c + rng.choice([-3.0, -0.1, 0.5, 1.0, 2.0], (COUNT, 1)) * turned
    low, high = np.zeros(COUNT), np.ones(COUNT)
    at = lambda share: np.linalg.norm(to_segment(a + share[:, None] * (b - a), c, d), axis=1)
    for _ in range(80):  # thirds: the distance of a point on ab to cd is convex in where that point is
        one, other = low + (high - low) / 3.0, high - (high - low) / 3.0
        nearer = at(one) < at(other)
        low, high = np.where(nearer, low, one), np.where(nearer, other, high)
    ends = [np.linalg.norm(to_segment(*end), axis=1) for end in ((a, c, d), (b, c, d), (c, a, b), (d, a, b))]
    expected = np.minimum(at(low), np.min(ends, axis=0))
    np.testing.assert_allclose(compiled("segments", a, b, c, d), expected, rtol=1e-9, atol=1e-12 * length)


def test_distances_of_points_and_triangles(compiled):
    """Every second triangle is nearly a line."""
    rng = np.random.default_rng(4)
    p, x = rng.uniform(-1, 1, (COUNT, 3)), rng.uniform(-1, 1, (COUNT, 3, 3))
    half = COUNT // 2
    x[::2, 2] = x[::2, 0] + rng.uniform(0, 1, (half, 1)) * (x[::2, 1] - x[::2, 0])
    x[::2, 2] += 10.0 ** rng.uniform(-9, -1, (half, 1)) * rng.standard_normal((half, 3))
    np.testing.assert_allclose(compiled("triangles", p, x), to_facets(p, x), rtol=1e-9, atol=1e-12)
