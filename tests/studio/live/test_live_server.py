"""Whom the live page's server answers, and what it serves."""

import asyncio
import socket
import urllib.error
import urllib.request

import pytest

viser = pytest.importorskip("viser", reason="the live page needs viser (extra `live`)")
connect = pytest.importorskip("websockets.asyncio.client").connect

from pdvol.errors import InputError  # noqa: E402
from pdvol.studio.live.server import FORBIDDEN, LocalServer  # noqa: E402
from sockets import listening_addresses  # noqa: E402


@pytest.fixture(scope="module")
def server():
    made = LocalServer("127.0.0.1", 0, "a page")
    yield made
    made.stop()


def closed_with(server, **headers):
    """The code with which a websocket of a page with these headers is closed; None where it is served."""

    async def ask():
        url = f"ws://127.0.0.1:{server.get_port()}"
        protocol = [f"viser-v{viser.__version__}"]
        async with connect(url, subprotocols=protocol, additional_headers=headers, proxy=None) as socket:
            try:
                await asyncio.wait_for(socket.recv(), 5.0)
            except Exception:
                return socket.close_code
            return None

    return asyncio.run(ask())


def test_only_pages_of_its_own_are_answered(server):
    own = f"http://127.0.0.1:{server.get_port()}"
    assert closed_with(server, Origin=own) is None
    assert closed_with(server) is None  # a program of this machine
    assert closed_with(server, Origin="https://pdvol.invalid") == FORBIDDEN
    assert closed_with(server, Origin="http://127.0.0.1:1") == FORBIDDEN


def test_only_the_client_is_served(server):
    with urllib.request.urlopen(server.address) as page:
        assert b"<html" in page.read().lower()
    for path in ("/../_viser.py", "/%2e%2e/_viser.py", "/etc/passwd", "/runs"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(server.address + path)
        assert refused.value.code == 404
        refused.value.close()  # the server waits for it when it stops


def test_it_listens_on_this_machine_alone_and_opens_no_tunnel(server):
    assert listening_addresses(server.get_port()) == {"127.0.0.1"}
    with socket.create_server(("0.0.0.0", 0)) as open_to_all:
        assert listening_addresses(open_to_all.getsockname()[1]) == {"0.0.0.0"}, "the check sees what it looks for"
    assert server.request_share_url() is None


def test_an_address_of_another_machine_is_a_mistake():
    with pytest.raises(InputError, match="cannot listen"):
        LocalServer("192.0.2.1", 0, "a page")
