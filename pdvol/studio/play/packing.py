"""Arrays in few bytes, as text: quantised, filtered over time, compressed by zlib, in base64.

| filter | residual of state k |
|---|---|
| raw | none: the array's bytes, little-endian |
| picture | none: the bytes of a PNG or JPEG |
| 1 | q_k - q_(k-1): bodies at rest are zeros |
| 2 | (q_k - q_(k-1)) - (q_(k-1) - q_(k-2)): steady motion is, too; of states 0 and 1 as with filter 1 |

Residuals are taken modulo 2^b, folded so that small ones of both signs are small (0, -1, 1, -2 -> 0, 1, 2, 3), and
written component by component, low bytes before high bytes: (components, bytes of a number, states, points).
"""

import base64
import hashlib
import zlib

import numpy as np

LARGEST = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}
"""The largest quantised value of a type."""
TRIAL_EFFORT = 1  # zlib's effort where the filters are compared: their order hardly depends on it
EFFORT = 9  # zlib's effort in the file


class Chunks:
    """The arrays of one file. Equal arrays are stored once.

    Attributes
    ----------
    entries : list of dict
        `type`, `shape` and `filter` of each array.
    texts : list of str
        Its compressed bytes in base64.
    """

    def __init__(self) -> None:
        self.entries: list[dict] = []
        self.texts: list[str] = []
        self._known: dict[bytes, int] = {}

    def raw(self, values: np.ndarray) -> int:
        """The number under which an array is stored as it is."""
        data = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        return self._add(values, "raw", data)

    def picture(self, data: bytes) -> int:
        """The number under which the bytes of a PNG or JPEG are stored."""
        return self._add(np.frombuffer(data, dtype=np.uint8), "picture", data)

    def states(self, values: np.ndarray) -> int:
        """The number under which quantised values (states, points, components), uint8 or uint16, are stored."""
        tried = {order: residuals(values, order) for order in (1, 2)}
        order = min(tried, key=lambda order: len(zlib.compress(tried[order], TRIAL_EFFORT)))
        return self._add(values, str(order), tried[order])

    def _add(self, values: np.ndarray, chosen: str, data: bytes) -> int:
        entry = {"type": values.dtype.name, "shape": list(values.shape), "filter": chosen}
        key = hashlib.sha256(repr(entry).encode() + data).digest()
        if key not in self._known:
            self._known[key] = len(self.entries)
            self.entries.append(entry)
            self.texts.append(base64.b64encode(zlib.compress(data, EFFORT)).decode())
        return self._known[key]


def quantised(values: np.ndarray, low: np.ndarray, span: np.ndarray, kind: type = np.uint16) -> np.ndarray:
    """Whole numbers q with |low + span q / largest - values| at most half of span / largest; zero where span is.

    Parameters
    ----------
    values : (..., d) within low and low + span
    low, span : (d,)
    """
    largest = LARGEST[np.dtype(kind)]
    fractions = (values - low) / np.where(span > 0.0, span, 1.0)
    return np.round(np.clip(fractions, 0.0, 1.0) * largest).astype(kind)


def residuals(values: np.ndarray, order: int) -> bytes:
    """The filtered bytes of quantised values (states, points, components); see the module's table."""
    differences = values.copy()
    differences[1:] -= values[:-1]
    if order == 2:
        differences[2:] -= differences[1:-1].copy()
    bits = 8 * values.itemsize
    signed = differences.view(np.dtype(f"i{values.itemsize}"))
    folded = ((signed << 1) ^ (signed >> (bits - 1))).view(values.dtype)
    by_component = np.ascontiguousarray(np.moveaxis(folded, -1, 0), values.dtype.newbyteorder("<"))
    planes = by_component.view(np.uint8).reshape(*by_component.shape, values.itemsize)
    return np.ascontiguousarray(np.moveaxis(planes, -1, 1)).tobytes()
