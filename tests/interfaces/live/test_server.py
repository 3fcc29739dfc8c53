"""Tests by raw sockets who is let in to the page of a live session, and that junk neither stops nor moves anything."""

import socket
import threading
import time
import tracemalloc

import pytest
import umsgpack

import interfaces.live.server
from interfaces.live.page import open_live_page
from interfaces.live.server import MAX_CONNECTIONS, MAX_HEADERS, MAX_INPUT, MAX_PAGES
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


def refused(page):
    return dict(page._site.refused)


def clicks_at_the_right_address(page, client):
    """Whether a browser with the right address can still press a button."""
    before = page.controls.GetButtonClicks("keep")
    with client.open_scene() as scene:
        scene.sendall(CLICK)
        wait(lambda: page.controls.GetButtonClicks("keep") == before + 1)
        scene.sendall(frame(b"\x03\xe9", opcode=8))  # closes: going away
        answer(scene)
    return True


def test_the_right_address_gives_the_page_the_viewer_the_values_and_the_scene(page, client):
    status, body = client.ask(client.request())
    assert (status, b'id="meshcat-pane"' in body) == (200, True)
    status, body = client.ask(client.request(client.path + "meshcat.js"))
    assert (status, len(body) > 10**6) == (200, True)
    with client.connect() as connection:
        connection.sendall(client.request(client.path + "values"))
        assert b"text/event-stream" in connection.recv(4096)
        assert clicks_at_the_right_address(page, client)
    assert refused(page) == {}


def test_the_page_is_shown_while_a_viewer_is_connected(page, client):
    assert not page.is_shown
    with client.open_scene():
        wait(lambda: page.is_shown)
    wait(lambda: not page.is_shown)


def test_a_viewer_gets_the_controls_and_every_change(page, client):
    with client.open_scene() as scene:
        page.controls.SetSliderValue("depth", 7.0)
        received = b""
        while b"set_control_value" not in received:
            part = scene.recv(4096)
            assert part, "closed"
            received += part
    assert received.index(b"set_control") < received.index(b"set_control_value")


FOREIGN = [
    ("foreign Host header", {"Host": "evil.example:7100"}),
    ("foreign Host header", {"Host": "evil.example", "Origin": "http://evil.example"}),  # rebound
    ("foreign Origin header", {"Origin": "http://evil.example"}),
    ("foreign Origin header", {"Origin": "http://127.0.0.1:9"}),
    ("foreign Origin header", {"Origin": "null"}),
]


def requests(client, path):
    """How to ask for each part of the page below a path: (function that makes the request, path of the part)."""
    return [(client.handshake, path), *((client.request, path + part) for part in ("", "values", "meshcat.js"))]


@pytest.mark.parametrize(("kind", "headers"), FOREIGN)
def test_foreign_requests_are_refused_even_with_the_token(page, client, kind, headers):
    for make, path in requests(client, client.path):
        status, body = client.ask(make(path, **headers))
        assert status == 403
        assert body == f"403 Forbidden: {kind}; open the address that the session has printed\n".encode()
    assert refused(page) == {kind: 4}
    assert not page.is_shown
    assert clicks_at_the_right_address(page, client)


def test_requests_without_the_token_are_refused(page, client, caplog):
    token = client.path.strip("/")
    wrong = ("", "wrong", "%ff", "..", token.swapcase(), token[:-1], token + "A")
    for make, path in [request for other in wrong for request in requests(client, f"/{other}/")]:
        status, body = client.ask(make(path))
        assert (status, body.startswith(b"403 Forbidden: missing or wrong token;")) == (403, True), path
    assert refused(page) == {"missing or wrong token": 4 * len(wrong)}
    assert caplog.records == []
    assert page.controls.GetButtonClicks("keep") == 0


def test_with_the_token_other_files_and_methods_are_not_served(page, client):
    for name in ("other", "../page.py", "meshcat.js/", "values/x", "%2e%2e/meshcat.js"):
        assert client.ask(client.request(client.path + name))[0] == 404
    for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS"):
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


def test_frames_that_are_no_events_are_counted_and_the_page_stays_connected(page, client):
    junk = [b"", b"\x00", b"\xc1", umsgpack.packb({"type": "button", "name": "quit"}), bytes(5000), bytes(MAX_INPUT)]
    with client.open_scene() as scene:
        for content in junk:
            scene.sendall(frame(content))
        scene.sendall(frame(b"keep", opcode=1))  # text
        scene.sendall(frame(b"", opcode=1))
        scene.sendall(CLICK)
        wait(lambda: page.controls.GetButtonClicks("keep") == 1)
        assert page.is_shown
        assert refused(page) == {"junk frame": len(junk) + 2}


BROKEN = {
    "too large": frame(b"", length=MAX_INPUT + 1),
    "absurdly large": frame(b"", length=2**62),
    "fragments that grow too large": frame(bytes(60_000), first=0) + frame(bytes(60_000), opcode=0),
    "reserved bits": frame(b"x", first=0xF0),
    "unknown opcode": frame(b"x", opcode=5),
    "continues nothing": frame(b"x", opcode=0),
    "text that is not UTF-8": frame(b"\xff\xfe", opcode=1),
    "large ping": frame(bytes(200), opcode=9),
}


def test_frames_that_break_the_protocol_close_their_connection_only(page, client):
    with client.open_scene() as other:
        for number, data in enumerate(BROKEN.values(), start=1):
            with client.open_scene() as scene:
                scene.sendall(data)
                answer(scene)  # until it is closed
            wait(lambda number=number: refused(page) == {"broken connection": number})
        other.sendall(CLICK)
        wait(lambda: page.controls.GetButtonClicks("keep") == 1)


JUNK_REQUESTS = {
    "garbage": b"\x00\xff\x16\x03\x01 hello\r\n\r\n",
    "no HTTP": b"hello\r\n\r\n",
    "other version": b"GET / HTTP/9.9\r\n\r\n",
    "a header without a colon": b"GET / HTTP/1.1\r\nHost 127.0.0.1\r\n\r\n",
    "endless header": b"GET / HTTP/1.1\r\nX: " + b"x" * (MAX_HEADERS + 1),
    "a body": b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n",
    "negative length": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -1\r\n\r\n",
    "no path": b"GET  HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
    "a path without a slash": b"GET foo HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
}


def test_requests_that_cannot_be_read_are_counted(page, client, caplog):
    for number, (name, data) in enumerate(JUNK_REQUESTS.items(), start=1):
        assert client.ask(data)[0] in {None, 400, 403}, name
        wait(lambda number=number: sum(refused(page).values()) == number)
    assert clicks_at_the_right_address(page, client)
    assert caplog.records == []  # the console of the session shows the count only


def test_a_slow_request_is_cut_off(monkeypatch):
    monkeypatch.setattr(interfaces.live.server, "REQUEST_TIME", 0.2)
    page = open_live_page()
    client = RawClient(page.address)
    try:
        with client.connect() as connection:
            start = time.monotonic()
            connection.sendall(client.request()[:20])
            assert connection.recv(100) == b""
            assert 0.1 < time.monotonic() - start < 5.0
        wait(lambda: refused(page) == {"junk request": 1})
    finally:
        page.close()


def test_the_number_of_connections_is_bounded(page, client):
    held = [client.connect() for _ in range(MAX_CONNECTIONS)]
    try:
        with client.connect() as connection:
            assert connection.recv(100) == b""  # closed at once
        wait(lambda: refused(page) == {"connection above the limit": 1})
    finally:
        for connection in held:
            connection.close()
    wait(lambda: client.ask(client.request())[0] == 200)
    assert clicks_at_the_right_address(page, client)


def test_the_number_of_pages_is_bounded(page, client):
    held = [client.open_scene() for _ in range(MAX_PAGES)]
    try:
        wait(lambda: len(page._site.pages) == MAX_PAGES)
        with client.open_scene() as scene:
            scene.sendall(CLICK)
            assert b"too many pages are open" in scene.recv(100)
            assert page.controls.GetButtonClicks("keep") == 0
        assert refused(page) == {"connection above the limit": 1}
        held[0].sendall(CLICK)
        wait(lambda: page.controls.GetButtonClicks("keep") == 1)
    finally:
        for connection in held:
            connection.close()


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
        scene.sendall(frame(umsgpack.packb({"type": "gamepad", "name": "", "gamepad": pad})))
        wait(lambda: page.controls.GetGamepad().axes == (0.0, 1.0))
    wait(lambda: page.controls.GetGamepad().axes == ())


def test_an_open_page_is_told_the_end_and_the_port_is_free_again(client, page):
    with client.connect() as connection, client.open_scene() as scene:
        connection.sendall(client.request(client.path + "values"))
        assert connection.recv(4096)
        closing = threading.Thread(target=page.close)
        start = time.monotonic()
        closing.start()
        values = b"".join(iter(lambda: connection.recv(65536), b""))
        answer(scene)  # closed
        closing.join()
        assert time.monotonic() - start < 1.5
    assert refused(page) == {}
    with pytest.raises(OSError, match="refused"):
        client.connect()
    assert b'"status": "ready", "over": true' in values
