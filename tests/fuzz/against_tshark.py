"""Wireshark as the other implementation: thousands of frames in one file, and one run of tshark for all of them."""

from __future__ import annotations

import struct
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from ipaddress import IPv4Address
from pathlib import Path

from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT
from pnfarm.protocols.profinet.wire.snmp.message import SNMP_PORT
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp
from tests.fuzz.layers import Answer

__all__ = ["LAYERS", "TOOL", "answers", "version"]

TOOL = "tshark"
ONE, OTHER = IPv4Address("10.77.0.11"), IPv4Address("10.77.1.250")
#: Each frame for itself: nothing is put together again, and checksums do not hide what is behind them.
OPTIONS = (
    "-o", "ip.defragment:FALSE", "-o", "dcerpc.reassemble_dcerpc:FALSE",
    "-o", "ip.check_checksum:FALSE", "-o", "udp.check_checksum:FALSE",
)  # fmt: skip
SECONDS = 300


def _ethernet(kind: int, number: int) -> bytes:
    """Each frame of another station, so that no conversation begins."""
    return b"\x02\x01" + number.to_bytes(4, "big") + b"\x02\x02" + number.to_bytes(4, "big") + kind.to_bytes(2, "big")


def _addresses(number: int) -> tuple[IPv4Address, IPv4Address]:
    return IPv4Address(0x0A000001 + number), IPv4Address(0x0B000001 + number)


def _ipv4(protocol: int, payload: bytes, number: int) -> bytes:
    source, destination = _addresses(number)
    return _ethernet(0x0800, number) + emit_ipv4(Ipv4Packet(source, destination, protocol, payload))


def _udp(port: int) -> Callable[[bytes, int], bytes]:
    def wrap(data: bytes, number: int) -> bytes:
        return _ipv4(17, emit_udp(UdpDatagram(port, port, data), *_addresses(number)), number)

    return wrap


def _behind(kind: int) -> Callable[[bytes, int], bytes]:
    return lambda data, number: _ethernet(kind, number) + data


def _number(text: str) -> int:
    return int(text, 0)  # with or without 0x


def _plain(text: str) -> str:
    return text


def _hex(text: str) -> str:
    return text.replace(":", "").lower()


def _guid(text: str) -> str:
    return text.lower()


def _all(convert: Callable[[str], object]) -> Callable[[str], tuple[object, ...]]:
    return lambda text: tuple(convert(one) for one in text.split(";")) if text else ()


def _first(convert: Callable[[str], object]) -> Callable[[str], object]:
    return lambda text: convert(text.split(";")[0])


#: Wireshark's name of a field, and how its text is read.
Field = tuple[str, Callable[[str], object]]
_N = _first(_number)
_RPC = {
    "packet type": ("dcerpc.pkt_type", _N),
    "flags": ("dcerpc.dg_flags1", _N),
    "object": ("dcerpc.obj_id", _first(_guid)),
    "interface": ("dcerpc.dg_if_id", _first(_guid)),
    "activity": ("dcerpc.dg_act_id", _first(_guid)),
    "sequence": ("dcerpc.dg_seqnum", _N),
    "operation": ("dcerpc.opnum", _N),
    "fragment": ("dcerpc.dg_frag_num", _N),
    "length": ("dcerpc.dg_frag_len", _N),
}
#: By layer: how octets become a frame, the protocols without which Wireshark did not see it, and our fields as its.
LAYERS = {
    "ethernet": (lambda data, number: data, "eth", {
        "destination": ("eth.dst", _first(_hex)), "source": ("eth.src", _first(_hex)),
        "priority": ("vlan.priority", _N), "vlan": ("vlan.id", _N),
    }),
    "arp": (_behind(0x0806), "arp", {
        "operation": ("arp.opcode", _N), "sender": ("arp.src.hw_mac", _hex), "target": ("arp.dst.hw_mac", _hex),
        "sender address": ("arp.src.proto_ipv4", _plain), "target address": ("arp.dst.proto_ipv4", _plain),
    }),
    "ipv4": (_behind(0x0800), "ip", {
        "source": ("ip.src", _first(_plain)), "destination": ("ip.dst", _first(_plain)),
        "protocol": ("ip.proto", _N), "time to live": ("ip.ttl", _N), "identification": ("ip.id", _N),
        "fragment offset": ("ip.frag_offset", _N), "more fragments": ("ip.flags.mf", _N),
    }),
    "udp": (lambda data, number: _ipv4(17, data, number), "udp", {
        "source": ("udp.srcport", _N), "destination": ("udp.dstport", _N), "length": ("udp.length", _N),
    }),
    "icmp": (lambda data, number: _ipv4(1, data, number), "icmp", {
        "type": ("icmp.type", _N), "code": ("icmp.code", _N), "identifier": ("icmp.ident", _N),
        "sequence": ("icmp.seq", _N),
    }),
    "lldp": (_behind(0x88CC), "lldp", {
        "chassis subtype": ("lldp.chassis.subtype", _N), "port subtype": ("lldp.port.subtype", _N),
        "port": ("lldp.port.id", _first(_plain)), "time to live": ("lldp.time_to_live", _N),
        "types": ("lldp.tlv.type", lambda text: tuple(kind for kind in _all(_number)(text) if kind)),
    }),
    "dcp": (_behind(0x8892), "pn_dcp", {
        "frame id": ("pn_rt.frame_id", _N), "service": ("pn_dcp.service_id", _N),
        "service type": ("pn_dcp.service_type", _N), "xid": ("pn_dcp.xid", _N),
        "options": ("pn_dcp.option", _all(_number)),
        "names": ("pn_dcp.suboption_device_nameofstation", _all(_plain)),
    }),
    "rta": (_behind(0x8892), "pn_rt", {
        "frame id": ("pn_rt.frame_id", _N), "destination": ("pn_io.alarm_dst_endpoint", _N),
        "source": ("pn_io.alarm_src_endpoint", _N), "type": ("pn_io.pdu_type.type", _N),
        "version": ("pn_io.pdu_type.version", _N), "send sequence": ("pn_io.send_seq_num", _N),
        "acknowledged sequence": ("pn_io.ack_seq_num", _N), "alarm": ("pn_io.alarm_type", _N),
        "slot": ("pn_io.slot_nr", _N), "subslot": ("pn_io.subslot_nr", _N),
        "module": ("pn_io.module_ident_number", _N),
    }),
    "rpc": (_udp(RPC_PORT), "dcerpc", _RPC),
    "call": (_udp(RPC_PORT), "dcerpc", {
        **_RPC, "maximum": ("pn_io.args_max", _N), "first block": ("pn_io.block_type", _N),
    }),
    "snmp": (_udp(SNMP_PORT), "snmp", {
        "version": ("snmp.version", _N), "community": ("snmp.community", _first(_plain)),
        "kind": ("snmp.data", _N), "request": ("snmp.request_id", _N), "status": ("snmp.error_status", _N),
        "index": ("snmp.error_index", _N), "names": ("snmp.name", _all(_plain)),
    }),
    "enip": (_udp(ENIP_PORT), "enip", {
        "command": ("enip.command", _N), "length": ("enip.length", _N), "session": ("enip.session", _N),
        "status": ("enip.status", _N), "context": ("enip.context", _first(_hex)), "options": ("enip.options", _N),
    }),
}  # fmt: skip
#: Wireshark's names of what is judged: what is wrong in a layer above, or behind the end, is not.
JUDGED = {
    "ethernet": ("Ethernet",), "arp": ("ARP",), "ipv4": ("IPv4",), "udp": ("UDP",), "icmp": ("ICMP",),
    "lldp": ("LLDP",), "dcp": ("PN-DCP",), "rta": ("PNIO",), "rpc": (), "call": ("DCERPC", "PNIO"),
    "snmp": ("SNMP",), "enip": (),
}  # fmt: skip
#: Layers in which an expert's remark is a refusal, too.
JUDGED_BY_EXPERTS = ("lldp", "dcp", "rta", "call", "snmp")
#: The last field of each header: without it Wireshark has not read the header.
NEEDED = {
    "ethernet": ("source",), "arp": ("target address",), "ipv4": ("destination",), "udp": ("length",),
    "icmp": ("code",), "lldp": ("time to live",), "dcp": ("xid",), "rta": ("acknowledged sequence",),
    "rpc": ("length",), "call": ("length",), "snmp": ("community",), "enip": ("options",),
}  # fmt: skip
_GENERAL = ("frame.number", "frame.protocols", "_ws.malformed", "_ws.expert.severity", "_ws.expert.message")
#: Severity "error" of an expert's remark.
ERROR = 0x800000


def version() -> str:
    done = subprocess.run([TOOL, "--version"], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0]


def _capture(path: Path, frames: Sequence[bytes]) -> None:
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))
        for number, frame in enumerate(frames):
            file.write(struct.pack("<IIII", number, 0, len(frame), len(frame)) + frame)


def answers(layer: str, inputs: Sequence[bytes]) -> list[Answer]:
    """Wireshark's answers, in order."""
    wrap, protocol, fields = LAYERS[layer]
    names = list(dict.fromkeys([*_GENERAL, *(name for name, _ in fields.values())]))
    with tempfile.TemporaryDirectory(prefix="pnfarm-diff-") as folder:
        path = Path(folder) / "all.pcap"
        _capture(path, [wrap(data, number) for number, data in enumerate(inputs)])
        command = [TOOL, "-n", "-r", str(path), *OPTIONS, "-T", "fields", "-E", "separator=/t", "-E", "aggregator=;"]
        command += [part for name in names for part in ("-e", name)]
        done = subprocess.run(command, capture_output=True, check=False, timeout=SECONDS)
    lines = done.stdout.decode("utf-8", "replace").split("\n")[:-1]
    rows = [dict(zip(names, line.split("\t"), strict=True)) for line in lines]
    if done.returncode != 0 or len(rows) != len(inputs):
        raise RuntimeError(f"{len(rows)} rows of {len(inputs)}: {done.stderr.decode()[-500:]}")
    return [_answer(layer, protocol, fields, row) for row in rows]


def _answer(layer: str, protocol: str, fields: Mapping[str, Field], row: dict[str, str]) -> Answer:
    if protocol not in row["frame.protocols"].split(":"):
        return "not seen"
    if any(f": {name}]" in row["_ws.malformed"] for name in JUDGED[layer]):
        return "malformed"
    remarks = zip(row["_ws.expert.severity"].split(";"), row["_ws.expert.message"].split(";"), strict=False)
    errors = [text for level, text in remarks if level and int(level) >= ERROR and "Malformed Packet" not in text]
    if errors and layer in JUDGED_BY_EXPERTS:
        return f"error: {errors[0]}"
    if not all(row[name] for name in (fields[field][0] for field in NEEDED[layer])):
        return "cut off"
    found: dict[str, object] = {}
    for field, (name, convert) in fields.items():
        try:
            found[field] = convert(row[name])
        except ValueError:  # a number was expected
            found[field] = row[name] or "absent"
    return found
