"""The gate between the stations and their link: acyclic frames pass it, rules lose some of them or hold them back.

Cyclic frames do not come by here; the engine acts on them (:mod:`pnfarm.engine.impair`).  Directions are seen from
the drive.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.faults.target import Evidence, LateRule, Way
from pnfarm.links.base import ETHERTYPE_IPV4, ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.protocols.profinet.wire.frame_id import FrameClass, classify_frame_id
from pnfarm.protocols.profinet.wire.rta import FIRST_ACK, RtaType, emit_rta, parse_rta
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.links.base import Clock, Link, LinkCounters, Port, PortSpec, Receiver

__all__ = [
    "DelayRule",
    "GateRule",
    "GatedLink",
    "acknowledging_nothing",
    "every_frame",
    "is_alarm_answer",
    "is_alarm_data",
    "is_dcp",
    "is_rpc",
]

_UDP = 17
#: SNMP and its traps: the only other UDP of a drive.
_SNMP = frozenset({161, 162})


def every_frame(frame: bytes) -> bool:
    """All of them."""
    del frame
    return True


def _payload(frame: bytes) -> tuple[int, bytes]:
    """EtherType and what follows, behind a VLAN tag if there is one; (0, b"") for what is too short."""
    start = 12
    if int.from_bytes(frame[12:14], "big") == ETHERTYPE_VLAN:
        start = 16
    if len(frame) < start + 2:
        return 0, b""
    return int.from_bytes(frame[start : start + 2], "big"), frame[start + 2 :]


def is_dcp(frame: bytes) -> bool:
    """Hello, Get, Set, Identify and their answers."""
    ethertype, payload = _payload(frame)
    if ethertype != ETHERTYPE_PROFINET or len(payload) < 2:
        return False
    return classify_frame_id(int.from_bytes(payload[:2], "big")) is FrameClass.DCP


def is_rpc(frame: bytes) -> bool:
    """UDP other than SNMP; later fragments carry no ports and are lost with the first."""
    ethertype, payload = _payload(frame)
    if ethertype != ETHERTYPE_IPV4 or len(payload) < 20 or payload[9] != _UDP:
        return False
    if int.from_bytes(payload[6:8], "big") & 0x1FFF:
        return True
    header = (payload[0] & 0x0F) * 4
    ports = {int.from_bytes(payload[at : at + 2], "big") for at in (header, header + 2)}
    return not ports & _SNMP


def _rta_type(frame: bytes) -> int | None:
    """PDUType of an RTA-PDU, None for every other frame."""
    ethertype, payload = _payload(frame)
    if ethertype != ETHERTYPE_PROFINET:
        return None
    try:
        return parse_rta(payload).type
    except DecodeError:
        return None


def is_alarm_data(frame: bytes) -> bool:
    """DATA-RTA-PDU: an alarm or an AlarmAck."""
    return _rta_type(frame) == RtaType.DATA


def is_alarm_answer(frame: bytes) -> bool:
    """Every RTA-PDU that can acknowledge another; an ERR-RTA-PDU cannot."""
    return _rta_type(frame) in {RtaType.DATA, RtaType.ACK, RtaType.NACK}


def acknowledging_nothing(frame: bytes) -> bytes | None:
    """What is left of a frame of :func:`is_alarm_answer`: of DATA its VarPart, of the others nothing."""
    _, payload = _payload(frame)
    pdu = parse_rta(payload)
    if pdu.type != RtaType.DATA:
        return None
    return frame[: len(frame) - len(payload)] + emit_rta(replace(pdu, ack_sequence=FIRST_ACK))


@dataclass(frozen=True, slots=True, eq=False)
class DelayRule:
    """Holds back the frames that ``selects`` says, for as long as ``late`` says."""

    selects: Callable[[bytes], bool]
    late: LateRule


@dataclass(frozen=True, slots=True)
class _Held:
    due_ns: int
    frame: bytes
    rules: tuple[LateRule, ...]

    def left(self, *, sent: bool) -> None:
        for rule in self.rules:
            rule.left(sent=sent)


class GateRule:
    """Loses the frames that ``selects`` says, on the ways in ``ways``, or lets something pass ``instead`` of them.

    ``probability`` of each, ``count`` (0: no limit) altogether, of which ``spent()`` happened elsewhere; not before
    ``armed()`` says so, and none at or after ``stop_ns`` (0: no end).  ``lost()`` is told each loss.  Each way has a
    random sequence of its own, so that one does not depend on the other.
    """

    def __init__(
        self,
        ways: Sequence[Way],
        selects: Callable[[bytes], bool] = every_frame,
        *,
        probability: float = 1.0,
        seed: int = 0,
        count: int = 0,
        stop_ns: int = 0,
        armed: Callable[[], bool] = lambda: True,
        spent: Callable[[], int] = lambda: 0,
        lost: Callable[[], None] = lambda: None,
        instead: Callable[[bytes], bytes | None] = lambda _: None,
    ) -> None:
        self._selects = selects
        self._probability = probability
        self._count = count
        self._stop_ns = stop_ns
        self._armed = armed
        self._spent = spent
        self._told = lost
        self.instead = instead
        self._random = {way: SplitMix64(seed + index) for index, way in enumerate(ways)}
        self._evidence = dict.fromkeys(ways, Evidence())

    def loses(self, way: Way, frame: bytes, now: int) -> bool:
        """Is this frame lost, or another passed instead?  Counts the evidence."""
        seen = self._evidence.get(way)
        if seen is None or (self._stop_ns and now >= self._stop_ns):
            return False
        if self.exhausted or not self._selects(frame) or not self._armed():
            return False
        lost = self._random[way].uniform() < self._probability
        self._evidence[way] = seen + (Evidence(1, 1, now, now, confirmed=True) if lost else Evidence(1))
        if lost:
            self._told()
        return lost

    def evidence(self, way: Way | None = None) -> Evidence:
        """Of one way, or of all."""
        if way is not None:
            return self._evidence[way]
        return sum(self._evidence.values(), Evidence())

    @property
    def exhausted(self) -> bool:
        """Whether ``count`` frames were lost, here and elsewhere."""
        return bool(self._count) and self.evidence().activations + self._spent() >= self._count


class GatedLink:
    """A link around ``inner``; ``clock`` stamps what is sent, received frames bring their time.

    What a port sends and a rule selects stays in order: nothing overtakes a frame that is held back.  Whoever runs the
    farm calls :meth:`handle_timeout` when :meth:`next_deadline` says so.
    """

    def __init__(self, inner: Link, clock: Clock) -> None:
        self.inner = inner
        self._clock = clock
        self._receiver: Receiver | None = None
        self._rules: dict[int, list[GateRule]] = {}
        self._delays: dict[int, list[DelayRule]] = {}
        self._held: dict[int, deque[_Held]] = {}

    def add(self, port: int, rule: GateRule) -> None:
        self._rules[port] = [*self._rules.get(port, ()), rule]

    def remove(self, port: int, rule: GateRule) -> None:
        remaining = [other for other in self._rules.get(port, ()) if other is not rule]
        if remaining:
            self._rules[port] = remaining
        else:
            self._rules.pop(port, None)

    def _passed(self, port: int, way: Way, frame: bytes, now: int) -> bytes | None:
        """What the rules leave of a frame; None when it is lost."""
        # every rule looks at every frame, so that each one's sequence does not depend on the others
        acting = [rule for rule in self._rules.get(port, ()) if rule.loses(way, frame, now)]
        left: bytes | None = frame
        for rule in acting:
            left = None if left is None else rule.instead(left)
        return left

    # frames held back

    def delay(self, port: int, rule: DelayRule) -> None:
        self._delays[port] = [*self._delays.get(port, ()), rule]

    def undelay(self, port: int, rule: DelayRule) -> None:
        """Take a rule back; with the last one gone, what is held back leaves at once."""
        remaining = [other for other in self._delays.get(port, ()) if other is not rule]
        if remaining:
            self._delays[port] = remaining
            return
        self._delays.pop(port, None)
        for held in self._held.pop(port, ()):
            self._let_go(port, held)

    def forget(self, port: int) -> None:
        """Whatever is held back never leaves: its sender has lost its supply."""
        for held in self._held.pop(port, ()):
            held.left(sent=False)

    def next_deadline(self) -> int | None:
        """When the next frame is to leave."""
        return min((queue[0].due_ns for queue in self._held.values()), default=None)

    def handle_timeout(self, now: int) -> None:
        for port, queue in list(self._held.items()):
            while queue and queue[0].due_ns <= now:
                self._let_go(port, queue.popleft())
            if not queue:
                self._held.pop(port, None)

    def _let_go(self, port: int, held: _Held) -> None:
        self.inner.send(port, held.frame)
        held.left(sent=True)

    def _hold(self, port: int, frame: bytes, now: int) -> bool:
        """Is this frame held back?"""
        waits = [(rule.late, rule.late.asked(now)) for rule in self._delays[port] if rule.selects(frame)]
        queue = self._held.get(port)
        late = sum(wait for _, wait in waits)
        if not waits or (not late and not queue):
            return False
        if queue is None:
            queue = self._held[port] = deque()
        due = max(now + late, queue[-1].due_ns if queue else 0)
        queue.append(_Held(due, frame, tuple(rule for rule, wait in waits if wait)))
        return True

    # the link

    @property
    def kind(self) -> str:
        return self.inner.kind

    @property
    def counters(self) -> LinkCounters:
        return self.inner.counters

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        return await self.inner.open(wanted)

    async def close(self) -> None:
        await self.inner.close()

    def send(self, port_index: int, frame: bytes) -> None:
        if port_index in self._rules:
            left = self._passed(port_index, "out", frame, self._clock())
            if left is None:
                return
            frame = left
        if port_index in self._delays and self._hold(port_index, frame, self._clock()):
            return
        self.inner.send(port_index, frame)

    def _receive(self, port_index: int, frame: bytes, now: int) -> None:
        if port_index in self._rules:
            left = self._passed(port_index, "in", frame, now)
            if left is None:
                return
            frame = left
        if self._receiver is not None:
            self._receiver(port_index, frame, now)

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver
        self.inner.set_receiver(self._receive)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        await self.inner.set_carrier(port_index, up)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await self.inner.set_mac(port_index, mac)
