"""What is fuzzed: every ``parse_*`` function of the code that reads octets of peers, found by its name and signature.

A parser takes octets, a :class:`RawBlock` or a :class:`Reader` first; ``little_endian`` is tried both ways. A new
parser needs no entry here, unless it has arguments of another kind: then this module says so at once.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random

import pnfarm.drives.profiles.profidrive
import pnfarm.protocols.profinet
import pnfarm.wire
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.blocks import RawBlock
from pnfarm.protocols.profinet.wire.blocks_any import _PARSERS
from pnfarm.wire.octets import Reader
from tests.fuzz.mutate import variation

__all__ = ["Parser", "parsers"]

ROOTS = (pnfarm.wire, pnfarm.protocols.profinet, pnfarm.drives.profiles.profidrive)
#: Texts that users write, not octets that peers send.
NOT_PEERS = {"parse_mac"}
#: Which layers of the corpus suit a parser; others take what their name says, or any octets.
LAYERS = {
    "parse_ethernet": ("frame",),
    "parse_arp": ("arp",),
    "parse_ipv4": ("ipv4",),
    "parse_udp": ("udp",),
    "parse_icmp": ("icmp",),
    "parse_dcp": ("dcp",),
    "parse_lldp": ("lldp",),
    "parse_rtc": ("rtc",),
    "parse_rta_error": ("rta",),
    "parse_rpc": ("rpc",),
    "parse_request_args": ("request-args",),
    "parse_response_args": ("response-args",),
    "parse_status": ("rpc-body",),
    "parse_fack": ("fack",),
    "parse_blocks": ("blocks", "record"),
    "split_blocks": ("blocks", "record"),
    "parse_raw_block": ("blocks", "record"),
    "parse_connect": ("request-0",),
    "parse_read_request": ("request-2", "request-5"),
    "parse_write_request": ("request-3",),
    "parse_read_response": ("response-2", "response-5"),
    "parse_write_response": ("response-3",),
    "parse_request": ("base-request",),
    "parse_response": ("base-response",),
    "parse_lookup_request": ("epm",),
    "parse_lookup_response": ("epm",),
    "parse_handle": ("epm",),
    "parse_handle_freed": ("epm",),
    "parse_tower": ("tower",),
}


@dataclass(frozen=True)
class Parser:
    """One parser with what to feed it; ``feed`` raises what the parser raises, :class:`DecodeError` apart."""

    name: str
    call: Callable[[bytes], object]
    pool: Sequence[bytes]

    def next_input(self, rng: Random) -> bytes:
        return variation(rng, self.pool)

    def feed(self, data: bytes) -> str:
        """``ok``, or the reason of the :class:`DecodeError`."""
        try:
            self.call(data)
        except DecodeError as exc:
            return exc.reason
        return "ok"


def _modules():
    for root in ROOTS:
        for found in pkgutil.walk_packages(root.__path__, root.__name__ + "."):
            yield importlib.import_module(found.name)


def _functions():
    """Every parser once, with the module that defines it."""
    for module in _modules():
        for name, function in vars(module).items():
            if not inspect.isfunction(function) or function.__module__ != module.__name__ or name in NOT_PEERS:
                continue
            if name.startswith("parse_") or name == "split_blocks":
                yield module, name, function


def _raw_block(kind, data):
    """``data`` begins with the version."""
    return RawBlock(kind, data[2:], int.from_bytes(data[:2], "big"))


def _calls(function, types):
    """How to call one parser with octets: suffix of the name, and the call."""
    first, *others = inspect.signature(function).parameters.values()
    kinds = {
        "bytes": lambda data: data,
        "bytes | bytearray | memoryview": lambda data: data,
        "Reader": Reader,
    }
    if str(first.annotation) == "RawBlock":
        shapes = [(f"-{kind:04x}", lambda data, kind=kind: _raw_block(kind, data)) for kind in types or (0,)]
    elif str(first.annotation) in kinds:
        shapes = [("", kinds[str(first.annotation)])]
    else:
        raise TypeError(f"{function.__module__}.{function.__name__} takes {first.annotation}: say how to feed it")
    options = [("", {})]
    for other in others:
        if other.name not in {"little_endian", "verify_checksum"}:
            if other.default is inspect.Parameter.empty:
                raise TypeError(f"{function.__module__}.{function.__name__} wants {other.name}: say what to give it")
            continue
        options = [
            (
                f"{text}-{other.name.split('_')[0] if value else 'not-' + other.name.split('_')[0]}",
                {**given, other.name: value},
            )
            for text, given in options
            for value in (True, False)
        ]
    for text, make in shapes:
        for more, given in options:
            yield text + more, lambda data, make=make, given=given: function(make(data), **given)


def _alike(function, types, layers):
    """Blocks of other types that the same parser takes."""
    return [octets for kind in types[function] for octets in layers.get(f"block-{kind:04x}", ())]


def parsers(layers: dict[str, list[bytes]]) -> list[Parser]:
    """All of them, by name."""
    everything = [octets for pool in layers.values() for octets in pool]
    types = {}
    for block_type, function in _PARSERS.items():
        types.setdefault(function, []).append(int(block_type))
    found = {}
    for module, name, function in _functions():
        for suffix, call in _calls(function, types.get(function)):
            if function in types:
                pool = layers.get(f"block{suffix[:5]}", []) or _alike(function, types, layers) or layers["block"]
            else:
                pool = [octets for layer in LAYERS.get(name, ()) for octets in layers.get(layer, ())] or everything
            title = f"{module.__name__.rsplit('.', 1)[-1]}.{name}{suffix}"
            found[title] = Parser(title, call, pool)
    return sorted(found.values(), key=lambda parser: parser.name)
