import pytest

from interfaces.live.access import FOREIGN_HOST, FOREIGN_ORIGIN, WRONG_TOKEN, Access, exposure_warning, page_host

OWN = "127.0.0.1:7100"


def objection(host=OWN, origin=None, token=None, needs_origin=False, listens_at="127.0.0.1"):
    access = Access(listens_at)
    headers = {"Host": host, "Origin": origin}
    return access.objection(
        access.token if token is None else token,
        {name: value for name, value in headers.items() if value is not None},
        needs_origin=needs_origin,
    )


@pytest.mark.parametrize("host", [OWN, "LOCALHOST:8000", "127.0.0.2", "[::1]:7100"])
def test_addresses_of_this_machine_and_localhost_are_own_hosts(host):
    assert objection(host=host) is None
    assert objection(host=host, listens_at="0.0.0.0") is None


@pytest.mark.parametrize("host", ["192.168.1.5:7100", "[2001:db8::1]:7100"])
def test_other_addresses_are_own_hosts_only_of_a_server_for_other_machines(host):
    assert objection(host=host) == FOREIGN_HOST
    assert objection(host=host, listens_at="::1") == FOREIGN_HOST
    assert objection(host=host, listens_at="localhost") == FOREIGN_HOST
    assert objection(host=host, listens_at="0.0.0.0") is None
    assert objection(host=host, listens_at="192.168.1.5") is None


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:7100",  # DNS rebinding
        "127.0.0.1.evil.example:7100",
        "127.0.0.1:7100@evil.example",
        "evil.example/127.0.0.1",
        "127.0.0.1, evil.example",
        "127.0.0.1:7100:80",
        "",
        None,
    ],
)
def test_other_names_are_foreign_hosts(host):
    assert objection(host=host) == FOREIGN_HOST


def test_the_name_at_which_the_page_listens_is_an_own_host_and_no_other():
    assert objection(host="lab.local:7100", listens_at="Lab.local") is None
    assert objection(host="lab2.local:7100", listens_at="Lab.local") == FOREIGN_HOST


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://127.0.0.1:7101",  # another server on this machine
        f"https://{OWN}",
        "http://localhost:7100",  # not the name in the Host header
        "null",  # a file, or a frame in a sandbox
    ],
)
def test_other_origins_are_foreign(origin):
    assert objection(origin=origin) == FOREIGN_ORIGIN


def test_the_own_origin_may_be_given_and_must_be_for_a_websocket():
    assert objection(origin=f"http://{OWN}", needs_origin=True) is None
    assert objection(origin="http://localhost:7100", host="LocalHost:7100", needs_origin=True) is None
    assert objection(needs_origin=True) == FOREIGN_ORIGIN
    assert objection() is None


@pytest.mark.parametrize("token", ["", "wrong", "é"])
def test_every_request_needs_the_token(token):
    assert objection(token=token) == WRONG_TOKEN


@pytest.mark.parametrize(
    ("host", "shown"),
    [
        ("localhost", "localhost"),
        ("0.0.0.0", "127.0.0.1"),
        ("::", "[::1]"),
        ("lab.local", "lab.local"),
    ],
)
def test_the_address_for_a_browser(host, shown):
    assert page_host(host) == shown


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost"])
def test_this_machine_alone_needs_no_warning(host):
    assert exposure_warning(host) is None


@pytest.mark.parametrize(
    ("host", "who"),
    [
        ("0.0.0.0", "all network interfaces of this machine (0.0.0.0): everyone in any of its networks can reach it"),
        ("192.168.1.5", "192.168.1.5: everyone in the network of this address can reach it"),
    ],
)
def test_a_warning_names_who_can_reach_the_page_and_what_they_can_do(host, who):
    warning = exposure_warning(host)
    assert warning.startswith(f"warning: the page listens on {who}.")
    assert "can watch and control" in warning
    assert "not encrypted" in warning
