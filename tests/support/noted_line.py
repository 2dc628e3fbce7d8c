"""A serial line without a medium: what leaves is noted, and what comes is what a test says."""

from __future__ import annotations

import asyncio
import time

from pnfarm.links.serial.line import LineCounters

__all__ = ["NotedLine", "Whole"]


class NotedLine:
    """A line that notes when octets left."""

    kind, where, is_up = "port", "/dev/ttyS7", True

    def __init__(self, *, has_rate: bool) -> None:
        self.has_rate, self.baud = has_rate, None
        self.counters = LineCounters()
        self.left: list[tuple[int, bytes]] = []
        self.sent = asyncio.Event()

    async def open(self):
        pass

    async def close(self):
        pass

    def send(self, octets):
        self.left.append((time.monotonic_ns(), octets))
        self.sent.set()

    def set_receiver(self, receiver):
        self.came = receiver

    def set_at_once(self, at_once):
        pass


class Whole:
    """Every piece is a telegram; a semicolon is between two."""

    dropped, is_whole = {}, True

    def split(self, octets, now):
        return octets.split(b";")

    def next_deadline(self):
        return None
