"""Talks to the page of a live session by raw sockets, as a program or a foreign page may."""

import re
import socket
import struct
from urllib.parse import urlsplit


class RawClient:
    """Knows the address of a page.

    Args:
        address: address with the token.
    """

    def __init__(self, address):
        parts = urlsplit(address)
        self.host, self.port, self.path, self.origin = parts.hostname, parts.port, parts.path, f"http://{parts.netloc}"
        self.authority = parts.netloc

    def connect(self):
        return socket.create_connection((self.host, self.port), timeout=3)  # less than the server's REQUEST_TIME

    def ask(self, request):
        """Sends bytes, and returns status and answer; the status is None if the connection is closed without one."""
        with self.connect() as connection:
            connection.sendall(request)
            return answer(connection)

    def request(self, path=None, *, method="GET", **headers):
        """Bytes of a request; a header that is None is left out, and ``_`` stands for a hyphen."""
        headers = {"Host": self.authority, "Connection": "close", **headers}
        lines = [f"{name.replace('_', '-')}: {value}" for name, value in headers.items() if value is not None]
        return "\r\n".join([f"{method} {path or self.path} HTTP/1.1", *lines, "", ""]).encode()

    def handshake(self, path=None, **headers):
        """Bytes of the handshake of a WebSocket, as `request`."""
        upgrade = {
            "Connection": "Upgrade",
            "Upgrade": "websocket",
            "Sec_WebSocket_Version": 13,
            "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==",
            "Origin": self.origin,
        }
        return self.request(path, **{**upgrade, **headers})

    def open_scene(self):
        """A WebSocket at the right address."""
        connection = self.connect()
        connection.sendall(self.handshake())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += connection.recv(1)
        assert head.startswith(b"HTTP/1.1 101 "), head
        return connection


def answer(connection):
    """Status and body of the answer on a connection: until its end, or until the connection is closed."""
    data = b""
    try:
        while part := connection.recv(65536):
            data += part
            head, _, body = data.partition(b"\r\n\r\n")
            length = re.search(rb"(?i)content-length: (\d+)", head)
            if data.startswith(b"HTTP/1.1 101 ") or (length and len(body) >= int(length[1]) and b" 40" in head):
                break
    except ConnectionResetError:
        pass  # the server has closed the connection before it read everything
    match = re.match(rb"HTTP/1.1 (\d+) ", data)
    return (int(match[1]) if match else None), data.partition(b"\r\n\r\n")[2]


def frame(content=b"", *, opcode=2, first=0x80, length=None):
    """A WebSocket frame from a browser, masked with zeros; ``length`` replaces the true one in its header."""
    length = len(content) if length is None else length
    if length < 126:
        size = struct.pack("!B", 0x80 | length)
    elif length < 65536:
        size = struct.pack("!BH", 0x80 | 126, length)
    else:
        size = struct.pack("!BQ", 0x80 | 127, length)
    return bytes([first | opcode]) + size + bytes(4) + content
