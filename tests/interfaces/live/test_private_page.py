"""Foreign pages in a real browser, foreign programs and wrong options, against a real session."""

import http.server
import re
import socket
import threading
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from skill.data.demonstration import read_demonstration
from tests.browser import open_page
from tests.interfaces.live.live_session import SIZE, live, press, wait_for_text
from tests.scripts.commands import error_line, invoke

REBOUND = "evil.example"  # a name that its owner lets point to this machine
RESOLVER = f"--host-resolver-rules=MAP {REBOUND} 127.0.0.1"
# Tries to open a WebSocket and to press a button there; the result is "open" or "refused".
TRY_WEBSOCKET = """
const [address, done] = arguments, server = new WebSocket(address);
const click = "\\x82\\xa4type\\xa6button\\xa4name\\xadstart (Space)";  // in msgpack
server.onopen = () => {
  server.send(Uint8Array.from(click, c => c.charCodeAt(0)));
  setTimeout(() => done("open"), 500);
};
server.onerror = () => done("refused");
"""
TRY_EVENTS = """
const [address, done] = arguments, server = new EventSource(address);
server.onmessage = () => done("open");
server.onerror = () => done("refused");
"""
TRY_FETCH = "const [address, done] = arguments; fetch(address).then(() => done('open'), () => done('refused'));"


@contextmanager
def foreign_site(folder):
    """Serves an empty page at a port of its own, and yields its address."""
    (folder / "index.html").write_text("<title>foreign</title>")
    handler = type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *args: None})
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), lambda *args: handler(*args, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()


def text(page):
    return page.run("return document.body.innerText")


def attempt(page, script, *addresses):
    return {address: page.driver.execute_async_script(script, address) for address in addresses}


@pytest.mark.nightly
@pytest.mark.browser
def test_foreign_pages_press_no_button_and_the_right_address_works_as_before(tmp_path):
    (tmp_path / "site").mkdir()
    with live(tmp_path) as session, foreign_site(tmp_path / "site") as foreign:
        address = session.address()
        port, path = urlsplit(address).port, urlsplit(address).path
        with open_page(foreign, size=SIZE, flags=(RESOLVER,)) as page:
            # Even a foreign page that has learned the token is refused, because of its Origin header.
            found = attempt(page, TRY_WEBSOCKET, *(f"ws://{h}:{port}{path}" for h in ("127.0.0.1", "localhost")))
            found |= attempt(page, TRY_WEBSOCKET, f"ws://127.0.0.1:{port}/")
            found |= attempt(page, TRY_EVENTS, address + "values")
            found |= attempt(page, TRY_FETCH, address)
            assert set(found.values()) == {"refused"}, found
            # A rebound name has the Origin header of the page itself; it is refused because of its Host header.
            page.driver.get(f"http://{REBOUND}:{port}{path}")
            assert text(page).startswith("403 Forbidden: foreign Host header")
            found = attempt(page, TRY_WEBSOCKET, f"ws://{REBOUND}:{port}{path}")
            assert set(found.values()) == {"refused"}, found
            # With its own name and origin, only the token is missing.
            page.driver.get(f"http://127.0.0.1:{port}/")
            assert text(page).startswith("403 Forbidden: missing or wrong token")
            found = attempt(page, TRY_WEBSOCKET, *(f"ws://127.0.0.1:{port}{wrong}" for wrong in ("/", "/wrong/")))
            assert set(found.values()) == {"refused"}, found

            page.driver.get(address)
            wait_for_text(page, "status", "ready")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            for junk in ("''", "'quit'", "new Uint8Array(0)", "new Uint8Array([193, 255])", "new Uint8Array(4000)"):
                page.run(f"viewer.connection.send({junk})")
            page.run(
                "viewer.connection.send(MeshCat.msgpack.encode({type: 'slider', name: 'depth mm (S W)', value: NaN}))"
            )
            press(page, " ")
            session.wait_for("recording:")
            page.run("viewer.connection.send(new Uint8Array(0))")
            press(page, "w", times=2)
            wait_for_text(page, "depth", "^0.[1-9]")
            page.run("window.before = true; viewer.connection.send(new Uint8Array(70000))")  # closes the connection
            page.wait("window.before === undefined")  # the page connects again by loading itself
            session.wait_for("the page was closed: demonstration discarded")
            wait_for_text(page, "status", "demonstration discarded")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            press(page, " ")
            session.wait_for("discarded[\\s\\S]*recording:")
            press(page, "w", times=2)
            wait_for_text(page, "depth", "^0.[1-9]")
            press(page, "g")
            session.wait_for("kept 000_good_live.parquet")
            press(page, "q")
            assert session.process.wait(30) == 0
        log = session.wait_for("[\\s\\S]*").group()
        assert log.count("recording:") == 2
        assert "Traceback" not in log
    assert read_demonstration(tmp_path / "out" / "000_good_live.parquet").good
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["000_good_live.parquet", "index.json"]


def listening(pid):
    """Addresses (host, port) at which a process listens."""
    inodes = {str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir()}
    found = []
    for table, family in (("tcp", socket.AF_INET), ("tcp6", socket.AF_INET6)):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *rest = line.split()
            if state == "0A" and f"socket:[{rest[5]}]" in inodes:
                host, port = local.split(":")
                words = [bytes.fromhex(host[k : k + 8])[::-1] for k in range(0, len(host), 8)]
                found.append((socket.inet_ntop(family, b"".join(words)), int(port, 16)))
    return found


@pytest.mark.nightly
@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads the tables of Linux")
@pytest.mark.parametrize("host", [None, "0.0.0.0"])
def test_a_session_listens_at_one_port_and_warns_if_others_reach_it(tmp_path, host):
    with live(tmp_path, options=("--host", host) if host else ()) as session:
        session.wait_for("ready: press Space")
        assert listening(session.process.pid) == [(host or "127.0.0.1", urlsplit(session.address()).port)]
        log = session.wait_for("[\\s\\S]*").group()
        warned = re.search(r"warning: the page listens on 0.0.0.0: others in its network can reach it", log)
        assert bool(warned) == bool(host)


@pytest.fixture
def arguments(tmp_path):
    return ("--live", "--out", tmp_path / "out")


def test_options_of_the_live_session_need_it(tmp_path):
    result = invoke("record", "--out", tmp_path / "out", "--asked", "asked.json")
    assert result.exit_code == 2
    assert "--driver, --host, --port, --asked and --observer need --live" in result.stderr


def test_an_unstable_scenario_leaves_no_page_and_no_folder_behind(tmp_path, arguments):
    path = tmp_path / "stiff.yaml"
    path.write_text(yaml.safe_dump({"coupling": {"stiffness": 1e9}}))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    result = invoke("record", *arguments, "--scenario", path, "--port", port)
    assert "stiffness" in error_line(result) or "coupling" in error_line(result)
    assert not (tmp_path / "out").exists()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))
