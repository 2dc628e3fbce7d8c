"""One device and any number of controllers' ARs in memory; every call and alarm frame is carried at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Address
from uuid import UUID

from cm_support import DRIVE
from cmctl_pair import Memory
from cmctl_peers import DEVICE_MAC, make_plan

from pnfarm.protocols.profinet.cm.ar import Ar
from pnfarm.protocols.profinet.cm.controller.cmctl import CmController
from pnfarm.protocols.profinet.cm.controller.events import ArEstablished, CmctlEvent, SubmodulesChanged
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
from pnfarm.protocols.profinet.cm.device import events as device_events
from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
from pnfarm.protocols.profinet.description import DeviceDescription, Plugged
from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

SECOND = 1_000_000_000
SHARED = replace(DRIVE, limits=replace(DRIVE.limits, max_ars=2))
PAP, TELEGRAM = (0x3A00, 1, 1), (0x3A00, 1, 2)


class RefusingMemory(Memory):
    """With every write in order; what is in ``refused`` is refused."""

    def __init__(self) -> None:
        super().__init__()
        self.writes: list[tuple[int, int, int, int]] = []
        self.refused: set[int] = set()

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        if index in self.refused:
            return RecordError(AccessError.INVALID_INDEX)
        self.writes.append((api, slot, subslot, index))
        return super().write(ar, api, slot, subslot, index, data, now)


@dataclass
class End:
    """One controller's AR on the wire."""

    machine: CmController
    peer: Peer
    events: list[CmctlEvent] = field(default_factory=list)

    @property
    def mac(self) -> bytes:
        return self.machine.plan.controller_mac

    def take(self, kind: type) -> list[CmctlEvent]:
        """Events of a kind since the last look; all others are forgotten, too."""
        found = [event for event in self.events if isinstance(event, kind)]
        self.events.clear()
        return found

    def unusable(self) -> dict[tuple[int, int], str] | None:
        """The last word on what cannot be used, by slot and subslot; None when nothing was said."""
        found = self.take(SubmodulesChanged)
        if not found:
            return None
        last = found[-1]
        assert isinstance(last, SubmodulesChanged)
        return {key[1:]: why for key, why in last.unusable.items()}


class Wire:
    """``ready`` says whether the device's application gets ready; ``late`` keeps answers of an operation back."""

    def __init__(self, description: DeviceDescription = DRIVE) -> None:
        self.plugged, self.records = Plugged(description), RefusingMemory()
        self.device = CmDevice(
            description, self.plugged, self.records, mac=DEVICE_MAC, station_name="axis-01", diagnosis=DiagnosisStore()
        )
        self.ends: list[End] = []
        self.now = SECOND
        self.ready = True
        self.device_events: list[device_events.CmEvent] = []
        #: (opnum, first block's type) of each call that a controller made.
        self.calls: list[tuple[int, int]] = []
        #: Answers by opnum and block type that do not reach the controller before :meth:`let_go`.
        self.late: set[tuple[int, int]] = set()
        self._kept: list[Callable[[], None]] = []

    def join(self, **changes: object) -> End:
        """One more controller; it gets an identity of its own."""
        number = len(self.ends) + 1
        own = {
            "controller_name": f"plc-{number}",
            "controller_mac": bytes([2, 0, 0, 0, 0xC0, number]),
            "controller_object_uuid": UUID(f"dea00000-6c97-11d1-8271-0064010100{number:02x}"),
            "ar_uuid": UUID(int=0x1000 + number),
            "session_key": number,
            "alarm_cr": AlarmCrBlockReq(local_alarm_reference=number),
            "input_frame_id": 0x8000 + number,
        }
        plan: ArPlan = make_plan(**{**own, **changes})
        end = End(CmController(plan), Peer(IPv4Address(f"10.77.0.{number}"), 49152))
        self.ends.append(end)
        return end

    def up(self, **changes: object) -> End:
        """One more controller, connected."""
        end = self.join(**changes)
        end.machine.connect(self.now)
        self.run()
        assert ArEstablished() in end.events, end.events
        end.events.clear()
        return end

    def run(self) -> None:
        """Until nothing moves."""
        while any([self._calls(), self._ready(), self._rta(), self._drain()]):
            pass

    def let_go(self) -> None:
        """Answers that were kept back arrive."""
        self.late.clear()
        kept, self._kept = self._kept, []
        for deliver in kept:
            deliver()
        self.run()

    def key(self, end: End) -> int:
        return next(ar.key for ar in self.device.ars if ar.uuid == end.machine.plan.ar_uuid)

    def _calls(self) -> bool:
        moved = False
        for end in self.ends:
            for call in end.machine.calls(self.now):
                moved = True
                head = int.from_bytes(call.payload[:2], "big")
                self.calls.append((call.opnum, head))
                self.device.receive_call(call.key, call.opnum, call.payload, call.args_maximum, end.peer, self.now)
                for key, status, payload in self.device.responses():
                    assert isinstance(key, int)

                    def deliver(end: End = end, key: int = key, status=status, payload=payload) -> None:  # type: ignore[no-untyped-def]  # default arguments bind the loop's
                        end.machine.call_returned(key, status, payload, self.now)

                    if (call.opnum, head) in self.late:
                        self._kept.append(deliver)
                    else:
                        deliver()
        return moved

    def _ready(self) -> bool:
        moved = False
        for call in self.device.calls():
            end = next(e for e in self.ends if e.peer.ip == call.peer_ip)
            end.machine.receive_call(call.token, Opnum.CONTROL, call.payload, self.now)
            moved = True
        for end in self.ends:
            for token, status, payload in end.machine.responses():
                self.device.call_returned(token, status, payload, self.now)
                moved = True
        return moved

    def _rta(self) -> bool:
        moved = False
        for frame in self.device.rta_to_send():
            end = next(e for e in self.ends if e.mac == frame.destination)
            end.machine.receive_rta(frame.payload, DEVICE_MAC, self.now)
            moved = True
        for end in self.ends:
            for _mac, pdu, _ in end.machine.rta_to_send():
                self.device.receive_rta(pdu, end.mac, self.now)
                moved = True
        return moved

    def _drain(self) -> bool:
        moved = False
        for end in self.ends:
            new = end.machine.events()
            end.events += new
            moved = moved or bool(new)
        for event in self.device.events():
            moved = True
            self.device_events.append(event)
            if isinstance(event, device_events.ArConnected):
                self.device.data_received(event.ar_key, self.now)
            if isinstance(event, device_events.PrmEndReceived) and self.ready:
                self.device.application_ready(event.ar_key, self.now, event.sequence)
        return moved

    def device_unusable(self, end: End) -> set[tuple[int, int]]:
        """What the device holds unusable in this AR."""
        key = self.key(end)
        found = [e for e in self.device_events if isinstance(e, device_events.SubmodulesChanged) and e.ar_key == key]
        return {(slot, subslot) for _, slot, subslot in found[-1].unusable} if found else set()
