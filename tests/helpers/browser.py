"""Pages in a headless Chromium, driven by Playwright: what they show as arrays, what they complain about, what they ask
of a network. WebGL is drawn in software. No wait is without end, and the browser ends with its test.
"""

import io
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

CHROMIUM = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
"""Names of the browser in PATH: Debian's headless one, then what a machine with a screen has."""
PATIENCE = 60.0
"""[s] for one action or wait on a page: software rendering on a busy machine."""
OPTIONS = (
    "--no-sandbox",  # root, in containers
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",  # nothing but this machine
)


class Tab:
    """One page of a browser.

    Attributes
    ----------
    page : playwright.sync_api.Page
        For everything that is not here: `locator`, `keyboard`, `evaluate`, `wait_for_function`.
    complaints : list of str
        Errors and warnings of the console, and exceptions that nothing caught.
    requests : list of str
        Addresses asked for over a network, the page's own included if it has one.
    """

    def __init__(self, page):
        self.page = page
        self.complaints: list[str] = []
        self.requests: list[str] = []
        page.set_default_timeout(1000 * PATIENCE)
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.complaints.append(f"exception: {error}"))
        page.on("request", self._asked)
        page.on("websocket", lambda socket: self.requests.append(socket.url))

    def _said(self, message) -> None:
        # Chromium remarks on pixels read back by a screenshot, which no user does.
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            self.complaints.append(f"{message.type}: {message.text}")

    def _asked(self, request) -> None:
        if request.url.startswith(("http:", "https:", "ws:", "wss:", "ftp:")):
            self.requests.append(request.url)

    def open(self, address: str | Path) -> "Tab":
        """Load an address or a file, up to the load event."""
        self.page.goto(address.resolve().as_uri() if isinstance(address, Path) else address)
        return self

    def until(self, expression: str, patience: float = PATIENCE) -> None:
        """Wait until an expression of JavaScript holds; pages whose policy forbids `eval` have no other way."""
        end = time.monotonic() + patience
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, f"{expression} did not hold within {patience:g} s; {self.complaints}"
            self.page.wait_for_timeout(30)

    def picture(self, selector: str | None = None, path: Path | None = None) -> np.ndarray:
        """(height, width, 3) uint8: what the page, or one element of it, looks like now; also written to `path`."""
        shown = self.page if selector is None else self.page.locator(selector)
        return np.asarray(Image.open(io.BytesIO(shown.screenshot(path=path))).convert("RGB"))


@contextmanager
def chromium(width: int = 1000, height: int = 700) -> Iterator[Tab]:
    """A fresh browser with an empty page of this size [pixels]. Skips the test where there is no browser."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (extra `test`)")
    executable = next((found for name in CHROMIUM if (found := shutil.which(name))), None)
    if executable is None:
        pytest.skip("there is no Chromium in PATH: PDVOL_BROWSER=1 ./run pytest ... takes an environment with one")
    with sync_api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=executable, args=OPTIONS, timeout=1000 * PATIENCE)
        try:
            yield Tab(browser.new_page(viewport={"width": width, "height": height}))
        finally:
            browser.close()


def busy(picture: np.ndarray) -> float:
    """Share of the pixels that have another colour than the most frequent one: 0 for an empty picture."""
    _, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    return 1.0 - counts.max() / counts.sum()


def difference(one: np.ndarray, other: np.ndarray, shade: int = 12) -> float:
    """Share of the pixels in which a channel differs by more than `shade` of 255; 1 for pictures of different sizes."""
    if one.shape != other.shape:
        return 1.0
    return float((np.abs(one.astype(int) - other).max(axis=2) > shade).mean())
