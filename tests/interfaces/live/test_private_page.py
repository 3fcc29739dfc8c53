"""Foreign pages in a real browser, foreign programs and wrong options, against a real session."""

import http.server
import socket
import threading
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest
import yaml

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


@pytest.mark.nightly
@pytest.mark.browser
def test_foreign_pages_press_no_button_and_the_right_address_works_as_before(tmp_path):
    (tmp_path / "site").mkdir()
    with live(tmp_path) as session, foreign_site(tmp_path / "site") as foreign:
        address = session.address()
        port, path = urlsplit(address).port, urlsplit(address).path
        with open_page(foreign, size=SIZE, flags=(RESOLVER,)) as page:
            # Even a foreign page that has learned the token is refused, because of its Origin header.
            for host in ("127.0.0.1", "localhost"):
                assert page.driver.execute_async_script(TRY_WEBSOCKET, f"ws://{host}:{port}{path}") == "refused"
            assert page.driver.execute_async_script(TRY_FETCH, address) == "refused"
            # A rebound name has the Origin header of the page itself; it is refused because of its Host header.
            page.driver.get(f"http://{REBOUND}:{port}{path}")
            assert page.run("return document.body.innerText").startswith("403 Forbidden: foreign Host header")
            assert page.driver.execute_async_script(TRY_WEBSOCKET, f"ws://{REBOUND}:{port}{path}") == "refused"
            # With its own name and origin, only the token is missing.
            page.driver.get(f"http://127.0.0.1:{port}/")
            assert page.driver.execute_async_script(TRY_WEBSOCKET, f"ws://127.0.0.1:{port}/wrong/") == "refused"

            page.driver.get(address)
            wait_for_text(page, "status", "ready")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            press(page, " ")
            session.wait_for("recording:")
            page.run("window.before = true; viewer.connection.send(new Uint8Array(70000))")  # closes the connection
            page.wait("window.before === undefined")  # the page connects again by loading itself
            session.wait_for("the page was closed: demonstration discarded")
            wait_for_text(page, "status", "demonstration discarded")
            press(page, "q")
            assert session.process.wait(30) == 0
        log = session.wait_for("[\\s\\S]*").group()
    assert log.count("recording:") == 1
    assert "Traceback" not in log


def test_options_of_the_live_session_need_it(tmp_path):
    result = invoke("record", "--out", tmp_path / "out", "--asked", "asked.json")
    assert result.exit_code == 2
    assert "--driver, --host, --port, --asked and --observer need --live" in result.stderr


def test_an_unstable_scenario_leaves_no_page_and_no_folder_behind(tmp_path):
    path = tmp_path / "stiff.yaml"
    path.write_text(yaml.safe_dump({"coupling": {"stiffness": 1e9}}))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    result = invoke("record", "--live", "--out", tmp_path / "out", "--scenario", path, "--port", port)
    assert "stiffness" in error_line(result) or "coupling" in error_line(result)
    assert not (tmp_path / "out").exists()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))
