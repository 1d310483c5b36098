"""viser's server, which gives this page to this machine's browsers alone.

viser itself listens on all interfaces, answers any web page that asks, and can open a tunnel to a public address on a
client's request.
"""

import contextlib
import io
import socket
from typing import Any
from urllib.parse import urlsplit

import viser

from pdvol.errors import InputError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
FORBIDDEN = 1008  # websocket's code for what breaks a rule


class LocalServer(viser.ViserServer):
    """A viser server that answers pages of its own only.

    Parameters
    ----------
    host : address to listen on
    port : wanted; the next free one is taken where it is in use

    Raises
    ------
    InputError
        The machine has no such address.
    """

    def __init__(self, host: str, port: int, label: str):
        try:
            socket.getaddrinfo(host, port)
            with socket.create_server((host, 0)):
                pass
        except OSError as error:
            raise InputError(f"--host {host}: this machine cannot listen there ({error.strerror or error})") from None
        with contextlib.redirect_stdout(io.StringIO()):  # it announces itself
            super().__init__(host=host, port=port, label=label, verbose=False)
        self._websock_server.on_client_connect(self._refuse_others)

    @property
    def address(self) -> str:
        """The page's address."""
        host = self.get_host()
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        return f"http://{shown}:{self.get_port()}"

    def stop(self) -> None:
        """Close all connections and end the server's threads."""
        with contextlib.redirect_stdout(io.StringIO()):
            super().stop()

    def request_share_url(self, verbose: bool = True) -> None:
        """No tunnel: a client's request for one stays without an answer."""

    async def _refuse_others(self, connection: Any) -> None:
        """Close a connection that a page of another server, or under another name, has opened."""
        live = self._websock_server._live_connections.get(connection.client_id)
        if live is None:
            return
        headers = live.request.headers if live.request is not None else {}
        host, origin = headers.get("Host", ""), headers.get("Origin", "")
        own = urlsplit(f"//{host}").hostname or ""
        local = self.get_host() not in LOOPBACK or own in LOOPBACK
        if not local or (origin and urlsplit(origin).netloc != host):
            await live.close(FORBIDDEN, "this page belongs to another server")
