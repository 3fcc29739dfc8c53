"""A WebSocket client (RFC 6455) that waits for its answers: for a loop that sends a message and reads one in each tick.

Tornado's client needs a loop of events of its own. This one blocks in the thread that calls it, and another thread may
close it meanwhile.
"""

from __future__ import annotations

import base64
import hashlib
import http.client
import os
import socket
import struct
import time
from contextlib import suppress

MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # of the standard
CONTINUATION, TEXT, CLOSE, PING, PONG = 0, 1, 8, 9, 10
FINAL, MASKED = 0x80, 0x80
LARGEST = 1 << 20  # in units of bytes; the largest message that is read


class WebSocketClient:
    """A connection to ``ws://host:port/``.

    Args:
        host: name or address of the server.
        port: its port.
        timeout: longest wait for anything, s.

    Raises:
        OSError: here and from all methods, if there is no server, it is no WebSocket server, it does not answer in
            time, or it has closed the connection.
    """

    def __init__(self, host: str, port: int, *, timeout: float) -> None:
        self._timeout = timeout
        self._socket = socket.create_connection((host, port), timeout)
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._stream = self._socket.makefile("rb")
            self._shake_hands(f"{host}:{port}")
        except BaseException:
            self._socket.close()
            raise

    def send(self, text: str) -> None:
        """Sends a message."""
        self._send(TEXT, text.encode())

    def receive(self) -> str:
        """Waits for the next message."""
        message, began = b"", time.monotonic()
        while True:
            first, second = self._read(2)
            kind, length = first & 0x0F, second & 0x7F
            if length > 125:
                (length,) = struct.unpack("!H", self._read(2)) if length == 126 else struct.unpack("!Q", self._read(8))
            if second & MASKED or len(message) + length > LARGEST:
                raise OSError(f"it sent a frame of {length} bytes that is masked or too large")
            content = self._read(length)
            if kind == PING:
                self._send(PONG, content)
                if time.monotonic() - began > self._timeout:  # a server that only pings would be waited for for ever
                    raise TimeoutError("timed out")
            elif kind == CLOSE:
                raise ConnectionError("it closed the connection")
            elif kind in (TEXT, CONTINUATION):
                message += content
                if first & FINAL:
                    return message.decode(errors="replace")

    def close(self) -> None:
        """Says good-bye, and closes the connection; a receive() in another thread ends with an OSError."""
        with suppress(OSError):
            self._send(CLOSE, struct.pack("!H", 1000))
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _shake_hands(self, host: str) -> None:
        key = base64.b64encode(os.urandom(16))
        lines = ["GET / HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {key.decode()}", "Sec-WebSocket-Version: 13", "", ""]
        self._socket.sendall("\r\n".join(lines).encode())
        status = self._stream.readline(1024).decode(errors="replace").split()
        if status[1:2] != ["101"]:
            raise OSError(f"it is no WebSocket server: it answered '{' '.join(status)}'")
        try:
            accepted = http.client.parse_headers(self._stream)["Sec-WebSocket-Accept"]
        except http.client.HTTPException as error:
            raise OSError(f"it is no WebSocket server: {error}") from error
        if accepted != base64.b64encode(hashlib.sha1(key + MAGIC, usedforsecurity=False).digest()).decode():
            raise OSError(f"it is no WebSocket server: it accepted the key '{accepted}'")

    def _send(self, kind: int, content: bytes) -> None:
        length, mask = len(content), os.urandom(4)
        head = (
            bytes([FINAL | kind, MASKED | length]) if length < 126 else struct.pack("!BBH", FINAL | kind, 0xFE, length)
        )
        pad = (mask * (length // 4 + 1))[:length]
        masked = int.from_bytes(content, "big") ^ int.from_bytes(pad, "big")
        self._socket.sendall(head + mask + masked.to_bytes(length, "big"))

    def _read(self, number: int) -> bytes:
        found = self._stream.read(number)
        if len(found) < number:
            raise ConnectionError("it closed the connection")
        return found
