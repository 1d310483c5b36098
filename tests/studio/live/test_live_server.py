"""Whom the live page's server answers, and what it serves."""

import http.client
import socket
import urllib.error
import urllib.request

import pytest

pytest.importorskip("websockets", reason="the live page needs websockets (extra `live`)")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from pdvol.errors import InputError
from pdvol.studio.live.server import LocalServer
from sockets import listening_addresses

PAGE = "<html>a page</html>" + "x" * 1_000_000


@pytest.fixture(scope="module")
def server():
    made = LocalServer("127.0.0.1", 0, {"/": PAGE}.get, lambda browser: browser.send("welcome"))
    yield made
    made.stop()


def heard(server, **headers):
    """What a websocket of a page with these headers hears first; the status of a refusal."""
    url = f"ws://127.0.0.1:{server.port}/socket"
    try:
        with connect(url, additional_headers=headers, proxy=None) as connection:
            return connection.recv(timeout=5.0)
    except InvalidStatus as refused:
        return refused.response.status_code


def status(server, host, path="/"):
    """Of a request under this name of the server."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5.0)
    connection.request("GET", path, headers={"Host": host})
    return connection.getresponse().status


def test_only_pages_of_its_own_are_answered(server):
    own = f"http://127.0.0.1:{server.port}"
    assert heard(server, Origin=own) == "welcome"
    assert heard(server) == "welcome"  # a program of this machine
    assert heard(server, Origin="https://pdvol.invalid") == 403
    assert heard(server, Origin="http://127.0.0.1:1") == 403
    assert heard(server, Origin="null") == 403


def test_only_the_page_is_served_under_names_of_its_own(server):
    """A name that a foreign page resolves to this machine would otherwise be of the same origin."""
    assert status(server, f"localhost:{server.port}") == 200 and status(server, f"pdvol.invalid:{server.port}") == 403
    with urllib.request.urlopen(server.address) as page:
        assert page.read().decode() == PAGE
    for path in ("/../server.py", "/%2e%2e/server.py", "/etc/passwd", "/runs"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(server.address + path)
        assert refused.value.code == 404
        refused.value.close()


def test_it_listens_on_this_machine_alone_and_on_the_next_free_port(server):
    other = LocalServer("127.0.0.1", server.port, {}.get, lambda browser: None)
    other.stop()
    assert server.port < other.port < server.port + 100
    with pytest.raises(InputError, match="cannot listen"):
        LocalServer("192.0.2.1", 0, {}.get, lambda browser: None)
    assert listening_addresses(server.port) == {"127.0.0.1"}
    with socket.create_server(("0.0.0.0", 0)) as open_to_all:
        assert listening_addresses(open_to_all.getsockname()[1]) == {"0.0.0.0"}, "the check sees what it looks for"
