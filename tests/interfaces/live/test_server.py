"""Tests by raw sockets who is let in to the page of a live session, and that junk neither stops nor moves anything."""

import re
import socket
import threading
import time
import tracemalloc

import pytest
import umsgpack

import interfaces.live.page
from interfaces.live.access import exposure_warning, is_own_host, page_host
from interfaces.live.page import MAX_HEADERS, MAX_INPUT, PORTS, LivePage, open_live_page, page_source
from tests.interfaces.live.raw_client import RawClient, answer, frame

CLICK = frame(umsgpack.packb({"type": "button", "name": "keep"}))


@pytest.fixture
def page():
    page = open_live_page()
    page.controls.AddButton("keep", "KeyG")
    page.controls.AddSlider("depth", -10.0, 40.0, 0.5, 0.0, "KeyS", "KeyW")
    page.show(status="ready")
    yield page
    page.close()


@pytest.fixture
def client(page):
    return RawClient(page.address)


def wait(condition, timeout=10.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def clicks_at_the_right_address(page, client):
    """Whether a browser with the right address can still press a button."""
    with client.open_scene() as scene:
        scene.sendall(CLICK)
        wait(lambda: page.controls.clicked("keep"))
    return True


# ------------------------------------------------------------------ what is served


def test_the_right_address_gives_the_page_the_viewer_the_values_and_the_scene(page, client):
    status, body = client.ask(client.request())
    assert (status, b'id="meshcat-pane"' in body) == (200, True)
    status, body = client.ask(client.request(client.path + "meshcat.js"))
    assert (status, len(body) > 10**6) == (200, True)
    with client.connect() as connection:
        connection.sendall(client.request(client.path + "values"))
        assert b"text/event-stream" in connection.recv(4096)
        assert clicks_at_the_right_address(page, client)


def test_the_values_are_sent_as_one_object_and_only_when_they_change(page):
    page.show(kept=1)
    serial, messages = page.panel.since(0)
    assert messages == ['{"status": "ready", "kept": 1}']
    page.show(kept=1)
    assert page.panel.since(serial) == (serial, [])


def test_with_the_token_other_files_and_methods_are_not_served(page, client):
    for name in ("other", "../page.py", "meshcat.js/", "values/x", "%2e%2e/meshcat.js"):
        assert client.ask(client.request(client.path + name))[0] == 404
    for method in ("POST", "HEAD"):
        assert client.ask(client.request(method=method))[0] == 405
    assert clicks_at_the_right_address(page, client)


def test_the_answers_keep_the_address_out_of_caches_referrers_and_frames(client):
    with client.connect() as connection:
        connection.sendall(client.request())
        head = connection.recv(65536).partition(b"\r\n\r\n")[0].decode().lower()
    for header in (
        "cache-control: no-store",
        "referrer-policy: no-referrer",
        "x-content-type-options: nosniff",
        "content-security-policy: frame-ancestors 'none'",
    ):
        assert header in head
    assert "server:" not in head


def test_page_contains_the_panel():
    source = page_source().decode()
    assert source.index('id="meshcat-pane"') < source.index('id="status"') < source.index("</body>")
    assert "http://" not in source.replace('url.replace("http://"', "")  # nothing from elsewhere


def test_page_of_an_unsupported_drake_is_an_error(monkeypatch, tmp_path):
    other = tmp_path / "meshcat.html"
    other.write_text("<html><head></head><head></head><body></body></html>")
    monkeypatch.setattr("interfaces.live.page.FindResourceOrThrow", lambda _: str(other))
    with pytest.raises(ValueError, match=f"^{other}: unsupported version of Drake: '<head>' occurs 2 times"):
        LivePage(host="127.0.0.1", port=PORTS[-1])


# ---------------------------------------------------------------- who is let in


@pytest.mark.parametrize("host", ["localhost", "LocalHost", "127.0.0.1", "127.1.2.3", "[::1]"])
@pytest.mark.parametrize("listens_at", ["127.0.0.1", "localhost", "::1", "0.0.0.0"])
def test_localhost_and_addresses_of_this_machine_are_own_hosts(host, listens_at):
    assert is_own_host(host, listens_at=listens_at)


def test_other_addresses_are_own_hosts_of_a_server_in_the_network_only():
    address = "192.168.1.5"
    assert all(is_own_host(address, listens_at=host) for host in ("0.0.0.0", "::", "lab.local", address))
    assert not any(is_own_host(address, listens_at=host) for host in ("127.0.0.1", "LocalHost", "::1"))
    assert is_own_host("lab.local", listens_at="Lab.local")
    assert not is_own_host("lab2.local", listens_at="Lab.local")


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",  # DNS rebinding
        "127.0.0.1.evil.example",
        "127.0.0.1:7100@evil.example",
        "evil.example/127.0.0.1",
        "127.0.0.1, evil.example",
        "",
    ],
)
def test_other_names_are_foreign_hosts(host):
    assert not is_own_host(host, listens_at="127.0.0.1")


def requests(client, path):
    """How to ask for each part of the page below a path: (function that makes the request, path of the part)."""
    return [(client.handshake, path), *((client.request, path + part) for part in ("", "values", "meshcat.js"))]


@pytest.mark.parametrize(
    ("kind", "headers"),
    [
        ("foreign Host header", {"Host": "evil.example:7100"}),
        ("foreign Host header", {"Host": "evil.example", "Origin": "http://evil.example"}),  # rebound
        ("foreign Origin header", {"Origin": "http://evil.example"}),
        ("foreign Origin header", {"Origin": "http://127.0.0.1:9"}),  # another server on this machine
        ("foreign Origin header", {"Origin": "null"}),  # a file, or a frame in a sandbox
    ],
)
def test_foreign_requests_are_refused_even_with_the_token(page, client, kind, headers):
    for make, path in requests(client, client.path):
        status, body = client.ask(make(path, **headers))
        assert status == 403
        assert body == f"403 Forbidden: {kind}; open the address that the session has printed\n".encode()
    assert client.ask(client.handshake(Origin=None))[0] == 403  # a browser sends one with every handshake
    assert not page.is_shown
    assert clicks_at_the_right_address(page, client)


def test_requests_without_the_token_are_refused(page, client, caplog):
    token = client.path.strip("/")
    wrong = ("", "wrong", "..", token.swapcase(), token[:-1], token + "A")
    for make, path in [request for other in wrong for request in requests(client, f"/{other}/")]:
        status, body = client.ask(make(path))
        assert (status, body.startswith(b"403 Forbidden: missing or wrong token;")) == (403, True), path
    assert caplog.records == []
    assert not page.is_shown


# ------------------------------------------------------------------------- junk


@pytest.mark.parametrize(
    "data", [frame(b"", length=MAX_INPUT + 1), frame(b"x", first=0xF0), frame(b"\xff\xfe", opcode=1)]
)
def test_frames_that_are_too_large_or_break_the_protocol_close_their_connection_only(page, client, data):
    with client.open_scene() as other:
        with client.open_scene() as scene:
            scene.sendall(data)
            answer(scene)  # until it is closed
        other.sendall(CLICK)
        wait(lambda: page.controls.clicked("keep"))


@pytest.mark.parametrize(
    "data",
    [
        b"\x00\xff\x16\x03\x01 hello\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost 127.0.0.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: " + b"x" * (MAX_HEADERS + 1),
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n",
        b"GET foo HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
    ],
)
def test_requests_that_cannot_be_read_are_refused(page, client, data):
    assert client.ask(data)[0] in {None, 400, 403, 404}
    assert clicks_at_the_right_address(page, client)


def test_a_slow_request_is_cut_off(monkeypatch):
    monkeypatch.setattr(interfaces.live.page, "REQUEST_TIME", 0.1)
    page = open_live_page()
    try:
        client = RawClient(page.address)
        with client.connect() as connection:
            connection.sendall(client.request()[:20])
            assert connection.recv(100) == b""
    finally:
        page.close()


def test_a_browser_that_does_not_read_delays_nobody_and_costs_little_memory(page, client):
    with client.open_scene() as deaf, client.open_scene() as scene:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        tracemalloc.start()
        seen = 0
        for k in range(20):
            page.scene.SetProperty("big", "text", f"{k:02d}" + "x" * 10**6)
            while seen < (k + 1) * 10**6:
                part = scene.recv(2**20)
                assert part, "closed"
                seen += part.count(b"x")
        memory, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert memory < 8e6  # not the 20 MB that the deaf browser has not read


def test_the_gamepad_of_a_browser_that_has_gone_is_let_go(page, client):
    pad = {"index": 0, "axes": [0.0, 1.0], "button_values": []}
    with client.open_scene() as scene:
        scene.sendall(frame(b"\xc1"))  # junk changes nothing
        scene.sendall(frame(umsgpack.packb({"type": "gamepad", "name": "", "gamepad": pad})))
        wait(lambda: page.controls.GetGamepad().axes == (0.0, 1.0))
        assert page.is_shown
    wait(lambda: page.controls.GetGamepad().axes == () and not page.is_shown)


# --------------------------------------------------------------- address and end


def test_the_page_listens_on_this_machine_only_at_an_address_with_a_token(page):
    assert re.fullmatch(r"http://127\.0\.0\.1:71\d\d/[\w-]{32}/", page.address)
    assert page.announcement() == [f"open {page.address} in a browser"]
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", RawClient(page.address).port))  # an address that 0.0.0.0 includes


def test_error_names_the_port_that_is_taken(client):
    with pytest.raises(OSError, match=f"^port {client.port} is taken; choose another with --port$"):
        open_live_page(port=client.port)
    other = open_live_page()  # takes another one
    other.close()
    assert RawClient(other.address).port != client.port


@pytest.mark.parametrize(
    ("host", "reason"), [("192.0.2.1", "Cannot assign requested address"), ("no-such-host.invalid", "")]
)
def test_a_host_that_is_not_this_machine_is_named(host, reason):
    with pytest.raises(OSError, match=rf"^the page cannot listen on {host}, port \d+: {reason}"):
        open_live_page(host=host)


@pytest.mark.parametrize(
    ("host", "shown", "warns"),
    [
        ("127.0.0.1", "127.0.0.1", False),
        ("localhost", "localhost", False),
        ("::1", "[::1]", False),
        ("0.0.0.0", "127.0.0.1", True),
        ("::", "[::1]", True),
        ("192.168.1.5", "192.168.1.5", True),
    ],
)
def test_the_address_for_a_browser_and_a_warning_if_others_can_reach_it(host, shown, warns):
    assert page_host(host) == shown
    warning = exposure_warning(host)
    assert (warning is not None) is warns
    if warning is not None:
        assert warning.startswith(f"warning: the page listens on {host}: others in its network can reach it")


def test_an_open_page_is_told_the_end_and_the_port_is_free_again(client, page):
    with client.connect() as connection, client.open_scene() as scene:
        connection.sendall(client.request(client.path + "values"))
        assert connection.recv(4096)
        closing = threading.Thread(target=page.close)
        closing.start()
        values = b"".join(iter(lambda: connection.recv(65536), b""))
        answer(scene)  # closed
        closing.join()
    with pytest.raises(OSError, match="refused"):
        client.connect()
    assert b'"status": "ready", "over": true' in values
