"""``python enip_talk.py ADDRESS``: sequences of EtherNet/IP messages from standard input, and the answers to each.

A line is a JSON list of ``[octets, live]``: hexadecimal digits, and whether the session's handle goes in place of
theirs.  Each sequence has a TCP connection and a session of its own.  Behind each message goes a ListServices, known by
its context: when its answer comes, no other will.  The answer is a list of octets, ``silence``, ``closed``, ``no end``.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import contextlib
import json
import socket
import struct
import sys
from collections.abc import Callable, Iterable

__all__ = ["HEADER_OCTETS", "PROBE", "PROBE_CONTEXT", "REGISTER", "Stream", "answers"]

HEADER_OCTETS = 24
PORT = 44818
PROBE_CONTEXT = b"no more!"
REGISTER = struct.pack("<HHII8sI", 0x65, 4, 0, 0, b"register", 0) + b"\1\0\0\0"
PROBE = struct.pack("<HHII8sI", 0x04, 0, 0, 0, PROBE_CONTEXT, 0)
#: Seconds without an octet, after which a message is taken for one that waits for more.
PATIENCE = 0.5


class Stream:
    """Messages out of octets; ``more`` gives octets, none at the end of the stream, and None when it stays silent."""

    def __init__(self, send: Callable[[bytes], object], more: Callable[[], bytes | None]) -> None:
        self.send = send
        self._more = more
        self._held = b""

    def message(self) -> bytes | str:
        """The next one, ``closed`` or ``no end``."""
        while True:
            if len(self._held) >= HEADER_OCTETS:
                size = HEADER_OCTETS + int.from_bytes(self._held[2:4], "little")
                if len(self._held) >= size:
                    octets, self._held = self._held[:size], self._held[size:]
                    return octets
            octets = self._more()
            if not octets:
                return "no end" if octets is None else "closed"
            self._held += octets


def answers(stream: Stream, messages: Iterable[tuple[bytes, bool]]) -> list[bytes | str]:
    """One answer for each message, up to the end of the stream; ``silence`` where there is none."""
    stream.send(REGISTER)
    registered = stream.message()
    if isinstance(registered, str):
        return [registered]
    handle = registered[4:8]
    found: list[bytes | str] = []
    for octets, live in messages:
        stream.send((octets[:4] + handle + octets[8:] if live else octets) + PROBE)
        first = answer = stream.message()
        while isinstance(answer, bytes) and answer[12:20] != PROBE_CONTEXT:
            answer = stream.message()
        quiet = isinstance(first, bytes) and first[12:20] == PROBE_CONTEXT
        found.append("silence" if quiet else first)
        if isinstance(answer, str):
            if first is not answer:
                found.append(answer)
            break
    return found


def main(address: str) -> None:
    for line in sys.stdin:
        with socket.create_connection((address, PORT), 5) as connection:
            connection.settimeout(PATIENCE)

            def send(octets: bytes, connection: socket.socket = connection) -> None:
                with contextlib.suppress(OSError):  # it is closed, as the next read tells
                    connection.sendall(octets)

            def more(connection: socket.socket = connection) -> bytes | None:
                try:
                    return connection.recv(65536)
                except TimeoutError:
                    return None
                except ConnectionError:
                    return b""

            messages = [(bytes.fromhex(octets), live) for octets, live in json.loads(line)]
            found = answers(Stream(send, more), messages)
        print(json.dumps([one if isinstance(one, str) else one.hex() for one in found]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
