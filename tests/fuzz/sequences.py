"""What guided fuzzing feeds: every parser, and every protocol machine with a sequence of messages.

The input of a machine is its messages one after the other, each behind its length in two octets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from random import Random
from zlib import crc32

from tests.fuzz.corpus import gather
from tests.fuzz.machines import BETWEEN, MACHINES
from tests.fuzz.machines_enip import ENIP, enip_layers
from tests.fuzz.machines_more import MORE
from tests.fuzz.mutate import variation
from tests.fuzz.targets import parsers

__all__ = ["Target", "joined", "messages", "targets"]

#: Sequences that a machine begins with, and messages in each; more messages of one input are left out.
BEGIN, MOST = 12, 8
#: Machines that a new one of costs little: each sequence has its own, and does the same again.
CHEAP = ("alarm-channel", "decoder", "enip-decoder", "capture-file", "enip-target", "enip-originator")


@dataclass(frozen=True)
class Target:
    """``starter`` makes, in the process that fuzzes, what takes inputs; ``vary`` changes one in a way of its own."""

    name: str
    starter: Callable[[], Callable[[bytes], object]]
    pool: Sequence[bytes]
    vary: Callable[[Random, Sequence[bytes]], bytes] | None = None
    kept: bool = True


def messages(data: bytes) -> Iterator[bytes]:
    """The messages of a sequence, without empty ones; the last one may be short."""
    place = 0
    for _ in range(MOST):
        if place + 2 > len(data):
            return
        end = place + 2 + int.from_bytes(data[place : place + 2], "big")
        if data[place + 2 : end]:
            yield data[place + 2 : end]
        place = end


def joined(several: Sequence[bytes]) -> bytes:
    return b"".join(len(one).to_bytes(2, "big") + one for one in several)


def _starter(kind, layers):
    def start():
        machine, done = kind(Random(1), layers), 0

        def feed(data):
            nonlocal machine, done
            rng = Random(crc32(data))
            if kind.name in CHEAP:
                machine = kind(rng, layers)
            done += 1
            if done % BETWEEN == 0:
                machine.revive(rng)
            for message in messages(data):
                machine.feed(rng, message)

        return feed

    return start


def _begin(kind, layers):
    """Good sequences: the inputs of the other fuzzing."""
    rng = Random(kind.name)
    machine = kind(rng, layers)
    return [joined([machine.prepared_input(rng)[:0xFFFF] for _ in range(4)]) for _ in range(BEGIN)]


def targets() -> list[Target]:
    layers = {**gather().layers, **enip_layers()}
    found = [
        Target(
            parser.name, lambda parser=parser: parser.feed, parser.pool,
            None if parser.vary is variation else parser.vary,
        )
        for parser in parsers(layers)
    ]  # fmt: skip
    machines = [
        Target(f"machine {kind.name}", _starter(kind, layers), _begin(kind, layers), kept=False)
        for kind in (*MACHINES, *MORE, *ENIP)
    ]
    return [*found, *machines]
