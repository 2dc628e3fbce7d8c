"""What is fuzzed: every ``parse_*`` function of the code that reads octets of peers, found by its name and signature,
and every class with a layout (:class:`Structure`).


A parser takes octets, a :class:`RawBlock` or a :class:`Reader` first; ``little`` is tried both ways. A new
parser needs no entry here, unless it has arguments of another kind: then this module says so at once.  Beside them the
way from a description file to the device that it describes, and from a project to its stations.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random

import pnfarm.drives.profiles.profidrive
import pnfarm.protocols.enip
import pnfarm.protocols.profibus
import pnfarm.protocols.profinet
import pnfarm.wire
from pnfarm.buses.profinet.binding import describe_device
from pnfarm.drives import catalogue
from pnfarm.errors import DecodeError
from pnfarm.plant.fmi.description import FmuFileError, read_description
from pnfarm.protocols.profinet.wire.alarms import notification
from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, parse_rta
from pnfarm.protocols.profinet.wire.block import Block, RawBlock
from pnfarm.wire.layout import Structure
from pnfarm.wire.octets import Reader
from tests.fuzz.mutate import variation, varied_lines, varied_xml
from tests.fuzz.plugging import describe_everything, plug_every_module, plug_everything
from tests.fuzz.projects import import_caex, import_hwl, import_l5x
from tests.fuzz.states import check_changed, saved_states

__all__ = ["Parser", "parsers"]

ROOTS = (
    pnfarm.wire,
    pnfarm.protocols.profinet,
    pnfarm.protocols.enip,
    pnfarm.protocols.profibus,
    pnfarm.drives.profiles.profidrive,
)
#: Texts that users write, not octets that peers send.
NOT_PEERS = {"parse_mac", "parse_record", "parse_number", "parse_tokens", "parse_octets"}
#: Arguments that are not octets, with the values to try.
OPTIONS = {
    "little_endian": (True, False),
    "verify_checksum": (True, False),
    "usi": (0x1234, 0x8000, 0x8002, 0x8003, 0x8100),
    "large": (True, False),
    "header": (True, False),
    "code": (0xC1, 0xC7, 0xCA, 0xD0, 0xDA, 0xDC, 0xFF),
}
#: What every call of a parser is given besides the octets.
GIVEN = {
    "description": describe_device(catalogue.model("akd-profinet"), bytes.fromhex("020000000001"), strict=True),
}
#: Which layers of the corpus suit a parser; others take what their name says, or any octets.
LAYERS = {
    "parse_ethernet": ("frame",),
    "parse_arp": ("arp",),
    "parse_ipv4": ("ipv4",),
    "parse_udp": ("udp",),
    "parse_icmp": ("icmp",),
    "parse_dcp": ("dcp",),
    "parse_lldp": ("lldp",),
    "parse_rta": ("rta",),
    "parse_alarm": ("alarm",),
    "parse_alarm_items": ("alarm-items",),
    "parse_rpc": ("rpc",),
    "parse_request_args": ("request-args",),
    "parse_response_args": ("response-args",),
    "parse_status": ("rpc-body",),
    "parse_fack": ("fack",),
    "parse_blocks": ("blocks", "record"),
    "split_blocks": ("blocks", "record"),
    "RawBlock": ("blocks", "record"),
    "parse_fsu_data_adjust": ("record",),
    "parse_connect": ("request-0",),
    "IodReadReqHeader": ("request-2", "request-5"),
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
    "parse_snmp": ("snmp",),
    "parse_oid": ("oid",),
    "parse_integer": ("oid",),
    "parse_gsd": ("gsd",),
    "parse_gsd_file": ("gsd",),
    "parse_gsdml": ("gsdml",),
    "parse_xml": ("gsdml",),
    "parse_encapsulation": ("enip",),
    "parse_header": ("enip",),
    "parse_common_packet": ("enip-packet",),
    "parse_items": ("enip-items",),
    "parse_epath": ("enip-path",),
    "message.parse_request": ("enip-request",),
    "parse_reply": ("enip-reply",),
    "parse_multiple_service": ("enip-body",),
    "parse_forward_open": ("enip-body",),
    "parse_forward_close": ("enip-body",),
    "parse_unconnected_send": ("enip-body",),
    "parse_class1": ("enip-class1",),
    "parse_eds": ("eds",),
    "parse_sheet": ("eds",),
}
#: Parsers of text with a syntax of its own: octets changed at random would mostly break that alone.
DOCUMENTS = {
    "parse_gsdml": varied_xml,
    "parse_xml": varied_xml,
    "parse_gsd": varied_lines,
    "parse_gsd_file": varied_lines,
}


@dataclass(frozen=True)
class Parser:
    """One parser with what to feed it; ``feed`` raises what the parser raises, :class:`DecodeError` apart."""

    name: str
    call: Callable[[bytes], object]
    pool: Sequence[bytes]
    vary: Callable[[Random, Sequence[bytes]], bytes] = variation

    def next_input(self, rng: Random) -> bytes:
        return self.vary(rng, self.pool)

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


def _structures():
    """Every layout once, with the module that defines it; no class that is only there to be derived from."""
    for module in _modules():
        for kind in vars(module).values():
            if not (isinstance(kind, type) and issubclass(kind, Structure) and kind.__module__ == module.__name__):
                continue
            if kind is RawBlock or (kind.TYPES if issubclass(kind, Block) else not kind.__subclasses__()):
                yield module, kind


def _raw_block(kind, data):
    """``data`` begins with the version."""
    return RawBlock(kind, data[2:], int.from_bytes(data[:2], "big"))


def _value_name(name, value):
    if isinstance(value, bool):
        return name.split("_")[0] if value else f"not-{name.split('_')[0]}"
    return f"{name}-{value:04x}"


def _calls(function):
    """How to call one parser with octets: suffix of the name, and the call."""
    first, *others = inspect.signature(function).parameters.values()
    kinds = {
        "bytes": lambda data: data,
        "bytes | bytearray | memoryview": lambda data: data,
        "Reader": Reader,
        "RawBlock": lambda data: _raw_block(int.from_bytes(data[:2], "big"), data[2:]),
    }
    wanted = getattr(first.annotation, "__name__", str(first.annotation))
    if wanted in kinds:
        shapes = [("", kinds[wanted])]
    else:
        raise TypeError(f"{function.__module__}.{function.__name__} takes {first.annotation}: say how to feed it")
    options = [("", {})]
    for other in others:
        if other.name in GIVEN:
            options = [(text, {**given, other.name: GIVEN[other.name]}) for text, given in options]
            continue
        if other.name not in OPTIONS:
            if other.default is inspect.Parameter.empty:
                raise TypeError(f"{function.__module__}.{function.__name__} wants {other.name}: say what to give it")
            continue
        options = [
            (f"{text}-{_value_name(other.name, value)}", {**given, other.name: value})
            for text, given in options
            for value in OPTIONS[other.name]
        ]
    for text, make in shapes:
        for more, given in options:
            yield text + more, lambda data, make=make, given=given: function(make(data), **given)


def _suiting(module, name):
    """The layers of a parser; a name that two modules have stands with its module's."""
    return LAYERS.get(f"{module.__name__.rsplit('.', 1)[-1]}.{name}", LAYERS.get(name, ()))


def _alarms(rta: Sequence[bytes]) -> dict[str, list[bytes]]:
    """The blocks within RTA-PDUs and some that no farm sends, their items, and their bodies behind the version."""
    diagnosis = notification.AlarmNotification(
        1, 0x3A00, 1, 2, 0x100, 0x68, 0xA801, notification.parse_alarm_items(bytes.fromhex("8000800008000010"))
    )
    maintenance = notification.parse_alarm_items(bytes.fromhex("81000f0000080100000000000001" + "8003" + "00" * 16))
    found = {
        diagnosis.emit(): None,
        replace(diagnosis, items=maintenance).emit(): None,
    }
    found[notification.acknowledge(replace(diagnosis, high=True)).emit()] = None
    pdus = [parse_rta(octets) for octets in rta if octets[:2] in {b"\xfc\x01", b"\xfe\x01"}]
    found.update({pdu.body: None for pdu in pdus if pdu.type == RtaType.DATA})
    layers: dict[str, list[bytes]] = {"alarm": list(found), "alarm-items": []}
    for octets in found:
        layers.setdefault(f"block-{octets[:2].hex()}", []).append(octets[4:])
        if octets[0] == 0:
            layers["alarm-items"].append(octets[26:])
    return layers


def refusing_fmus(data: bytes) -> None:
    """The description of an FMU, whose refusal is another exception."""
    try:
        read_description(data)
    except FmuFileError as error:
        raise DecodeError("refused", str(error)) from error


def parsers(layers: dict[str, list[bytes]]) -> list[Parser]:
    """All of them, by name."""
    layers = {**layers, **_alarms(layers.get("rta", ()))}
    everything = [octets for pool in layers.values() for octets in pool]
    found = {}

    def add(title, call, pool, vary=variation):
        found[title] = Parser(title, call, pool or everything, vary)

    def suiting(module, name):
        return [octets for layer in _suiting(module, name) for octets in layers.get(layer, ())]

    for module, name, function in _functions():
        for suffix, call in _calls(function):
            title = f"{module.__name__.rsplit('.', 1)[-1]}.{name}{suffix}"
            add(title, call, suiting(module, name), DOCUMENTS.get(name, variation))
    for module, kind in _structures():
        title = f"{module.__name__.rsplit('.', 1)[-1]}.{kind.__name__}"
        types = kind.TYPES if issubclass(kind, Block) else ()
        for block_type in types:
            alike = [octets for other in types for octets in layers.get(f"block-{other:04x}", ())]
            pool = layers.get(f"block-{block_type:04x}") or alike or layers["block"]
            add(f"{title}-{block_type:04x}", lambda data, kind=kind, of=block_type: kind.of(_raw_block(of, data)), pool)
        if not types:
            pool = suiting(module, kind.__name__)
            add(title, kind.parse, pool)
            add(f"{title}-little", lambda data, kind=kind: kind.parse(data, little_endian=True), pool)
    found["station.plug_station"] = Parser("station.plug_station", plug_everything, layers.get("gsdml", ()), varied_xml)
    found["eds.describe"] = Parser("eds.describe", describe_everything, layers.get("eds", ()))
    found["fmi.description"] = Parser("fmi.description", refusing_fmus, layers.get("fmu", ()), varied_xml)
    found["station.plug_slave"] = Parser("station.plug_slave", plug_every_module, layers.get("gsd", ()), varied_lines)
    for name, call, vary in (("caex", import_caex, varied_xml), ("l5x", import_l5x, varied_xml),
                             ("hwl", import_hwl, varied_lines)):  # fmt: skip
        found[f"project.{name}"] = Parser(f"project.{name}", call, layers.get(name, ()), vary)
    found["state.check_state"] = Parser("state.check_state", check_changed, saved_states(), varied_lines)
    return sorted(found.values(), key=lambda parser: parser.name)
