"""A server that gives a page, and a websocket to it, to this machine's browsers alone."""

import logging
import socket
import threading
from collections.abc import Callable
from urllib.parse import urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from pdvol.errors import InputError, PdvolError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
PORTS_TRIED = 100  # from the wanted one on
LONGEST_MESSAGE = 65_536  # bytes from a page: it sends commands only
OPENING = 3.0  # seconds that a connection may be open without a request, as browsers open some ahead


class LocalServer:
    """Answers requests for its page, and pages of its own alone.

    Parameters
    ----------
    host : address to listen on
    port : wanted; the next free one is taken where it is in use
    page : the HTML of a path; None where there is none
    talk : what a websocket is served by, in a thread of its own; it ends soon after `stop`

    Raises
    ------
    InputError
        The machine has no such address.
    """

    def __init__(
        self, host: str, port: int, page: Callable[[str], str | None], talk: Callable[[ServerConnection], None]
    ):
        self._host, self._page = host, page
        listening = _listening(host, port)
        self.port = listening.getsockname()[1]
        errors = logging.Logger("pdvol.live", logging.ERROR)
        errors.addHandler(logging.StreamHandler())
        errors.addFilter(lambda record: record.msg != "opening handshake failed")  # a browser may give one up
        self._server = serve(
            talk,
            sock=listening,
            process_request=self._answer,
            compression=None,
            logger=errors,
            open_timeout=OPENING,
            close_timeout=1.0,
            max_size=LONGEST_MESSAGE,
            server_header=None,
        )
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """The page's address."""
        host = self._host
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        return f"http://{shown}:{self.port}"

    def stop(self) -> None:
        """Take no further connections."""
        self._server.shutdown()
        self._thread.join()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The page, a refusal, or None for a websocket that is served."""
        host, origin = request.headers.get("Host", ""), request.headers.get("Origin", "")
        local = self._host not in LOOPBACK or (urlsplit(f"//{host}").hostname or "") in LOOPBACK
        if not local or (origin and urlsplit(origin).netloc != host):
            return connection.respond(403, "this page belongs to another server\n")
        if request.path == "/socket":
            return None
        try:
            page = (self._page(request.path) or "").encode()
        except PdvolError as error:
            return connection.respond(404, f"{error}\n")
        if not page:
            return connection.respond(404, "there is no such page\n")
        headers = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(page))}
        return Response(200, "OK", Headers({**headers, "Cache-Control": "no-store", "Connection": "close"}), page)


def _listening(host: str, port: int) -> socket.socket:
    """A socket that listens at the wanted port, or the next free one."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for wanted in range(port, min(port + PORTS_TRIED, 65536)):
        try:
            return socket.create_server((host, wanted), family=family)
        except OSError as error:
            found = error
    raise InputError(f"--host {host}: this machine cannot listen there ({found.strerror or found})") from None
