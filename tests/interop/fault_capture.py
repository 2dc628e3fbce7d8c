"""What a capture shows of each drive while a fault is on it: frames dissected by tshark, octets read by scapy."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

from interop_rig import tshark_fields

#: One unit of the cycle counter, and one turn of it.
UNIT_SECONDS = 31.25e-6
TURN = 1 << 16

FIELDS = (
    "frame.number", "frame.time_epoch", "eth.src", "eth.dst", "frame.len",
    "pn_rt.frame_id", "pn_rt.cycle_counter", "pn_rt.ds", "pn_io.ioxs",
    "pn_dcp.service_id", "pn_dcp.service_type", "pn_dcp.suboption_device_nameofstation",
    "arp.opcode", "arp.src.proto_ipv4", "lldp.chassis.subtype", "pn_io.opnum", "dcerpc.pkt_type", "dcerpc.dg_act_id",
    "dcerpc.dg_seqnum", "pn_io.error_code", "pn_io.error_decode", "pn_io.error_code1", "pn_io.error_code2",
    "pn_io.block_type", "pn_io.alarm_type", "pn_io.pdu_type.type", "pn_io.send_seq_num", "ip.src", "udp.length",
    "_ws.col.Info",
)  # fmt: skip


def number(text: str) -> int | None:
    """The first of a field's values."""
    first = text.split(",", maxsplit=1)[0]
    return int(first, 0) if first else None


@dataclass(slots=True)
class Frame:
    """One frame.  ``octets`` without a VLAN tag; ``values`` has what tshark said, by field."""

    seconds: float
    values: dict[str, str]
    octets: bytes

    def __getitem__(self, name: str) -> str:
        return self.values[name]

    def number(self, name: str) -> int | None:
        return number(self.values[name])

    @property
    def cyclic(self) -> bool:
        return self.octets[12:14] == b"\x88\x92" and int.from_bytes(self.octets[14:16]) < 0xFC00

    @property
    def counter(self) -> int:
        return self.number("pn_rt.cycle_counter") or 0

    @property
    def status(self) -> int:
        return self.number("pn_rt.ds") or 0

    @property
    def ioxs(self) -> list[int]:
        return [int(text, 16) for text in self["pn_io.ioxs"].split(",") if text]

    def word(self, offset: int) -> int:
        """A word of the IO data, ``offset`` octets behind the frame id."""
        return int.from_bytes(self.octets[16 + offset : 18 + offset])

    @property
    def alarm(self) -> int | None:
        """AlarmType of an alarm notification."""
        is_notification = (self.number("pn_io.block_type") or 0) in {1, 2}
        return self.number("pn_io.alarm_type") if is_notification else None

    @property
    def aborts(self) -> bool:
        """Whether it is an ERR-RTA-PDU."""
        return self["pn_io.pdu_type.type"] in {"0x04", "4"}


@dataclass(slots=True)
class View:
    """One drive in the capture.

    ``quiet`` is before the fault; ``began`` and ``ended`` bound the time in which it certainly was in force.
    """

    mac: str
    quiet: float
    began: float
    ended: float
    sent: list[Frame] = field(default_factory=list)
    got: list[Frame] = field(default_factory=list)
    #: Frames of every other station, for those faults that bring one more.
    others: list[Frame] = field(default_factory=list)
    peers: dict[str, object] = field(default_factory=dict)

    def during(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if self.began <= frame.seconds <= self.ended]

    def before(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if frame.seconds < self.quiet]

    def after(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if frame.seconds > self.ended]

    @property
    def cyclic(self) -> list[Frame]:
        return [frame for frame in self.sent if frame.cyclic]

    def steps(self, frames: list[Frame]) -> list[int]:
        """Differences of the cycle counter from frame to frame, -32768 to 32767."""
        return [(b.counter - a.counter + TURN // 2) % TURN - TURN // 2 for a, b in itertools.pairwise(frames)]

    def gaps(self, frames: list[Frame]) -> list[float]:
        """Seconds from frame to frame."""
        return [b.seconds - a.seconds for a, b in itertools.pairwise(frames)]

    def lateness(self, frames: list[Frame]) -> list[float]:
        """Arrival against the cycle counter, seconds; only differences between them mean anything."""
        turn = TURN * UNIT_SECONDS
        first = self.before(self.cyclic)[0]
        zero = first.seconds - first.counter * UNIT_SECONDS
        return [(frame.seconds - frame.counter * UNIT_SECONDS - zero + turn / 2) % turn - turn / 2 for frame in frames]

    def answers(self, opnum: int) -> list[tuple[float, Frame]]:
        """Seconds from the first call to its answer, and the answer, for RPC of this operation."""
        asked: dict[tuple[str, str], float] = {}
        for frame in self.got:
            if frame["dcerpc.pkt_type"] == "0" and frame.number("pn_io.opnum") == opnum:
                asked.setdefault((frame["dcerpc.dg_act_id"], frame["dcerpc.dg_seqnum"]), frame.seconds)
        found = []
        for frame in self.sent:
            key = (frame["dcerpc.dg_act_id"], frame["dcerpc.dg_seqnum"])
            if frame["dcerpc.pkt_type"] == "2" and key in asked:
                found.append((frame.seconds - asked.pop(key), frame))
        return found

    def calls(self, block: int) -> list[Frame]:
        """The drive's own calls with this block (ApplicationReady: 0x0112)."""
        return [frame for frame in self.sent if frame.number("pn_io.block_type") == block]


def read_capture(path) -> list[Frame]:
    """Every frame, in order."""
    from scapy.utils import RawPcapNgReader

    with RawPcapNgReader(str(path)) as reader:
        octets = [data for data, _ in reader]
    frames = []
    for row in tshark_fields(path, *FIELDS):
        values = dict(zip(FIELDS, [*row, *[""] * (len(FIELDS) - len(row))], strict=True))
        data = octets[int(values["frame.number"]) - 1]
        if data[12:14] == b"\x81\x00":
            data = data[:12] + data[16:]
        frames.append(Frame(float(values["frame.time_epoch"]), values, data))
    return frames
