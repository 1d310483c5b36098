"""A player's page, read without the code that wrote it."""

import base64
import json
import re
import zlib

import numpy as np


class Decoded:
    """A player's page, read as its format says, with none of the code that wrote it."""

    def __init__(self, page: str):
        self.data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)[1])
        self.texts = re.findall(r'<script id="chunk-\d+" type="text/plain">(.*?)</script>', page, re.S)

    def array(self, number: int) -> np.ndarray:
        entry, data = self.data["chunks"][number], zlib.decompress(base64.b64decode(self.texts[number]))
        if entry["filter"] in ("raw", "picture"):
            return np.frombuffer(data, entry["type"]).reshape(entry["shape"])
        states, points, components = entry["shape"]
        size = np.dtype(entry["type"]).itemsize
        planes = np.frombuffer(data, np.uint8).reshape(components, size, states, points).astype(np.int64)
        folded = sum(planes[:, byte] << (8 * byte) for byte in range(size))
        values = np.where(folded % 2, -(folded + 1) // 2, folded // 2)
        if entry["filter"] == "2":
            values[:, 1:] = np.cumsum(values[:, 1:], axis=1)
        values = np.cumsum(values, axis=1) % 2 ** (8 * size)
        return np.moveaxis(values, 0, -1)

    def positions(self, packed: dict) -> np.ndarray:
        return np.array(packed["low"]) + np.array(packed["span"]) * self.array(packed["positions"]) / 65535
