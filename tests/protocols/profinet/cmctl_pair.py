"""A controller's AR and a device joined in memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from ipaddress import IPv4Address

from cm_support import DRIVE, IM0
from cmctl_peers import CONTROLLER_MAC, DEVICE_MAC, make_plan

from pnfarm.protocols.profinet.cm.ar import Ar
from pnfarm.protocols.profinet.cm.controller.cmctl import CmController
from pnfarm.protocols.profinet.cm.controller.events import (
    CmctlEvent,
)
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
from pnfarm.protocols.profinet.cm.device import events as device_events
from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
from pnfarm.protocols.profinet.description import (
    DeviceDescription,
    Limits,
    ModuleDescription,
    Plugged,
    SubmoduleDescription,
)
from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

SECOND = 1_000_000_000
CONTROLLER = Peer(IPv4Address("10.77.0.1"), 49152)


class Memory:
    """Records that live in a dictionary; whatever was not written is no index."""

    def __init__(self) -> None:
        self.kept: dict[tuple[int, int, int, int], bytes] = {}

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        found = self.kept.get((api, slot, subslot, index))
        return RecordError(AccessError.INVALID_INDEX) if found is None else found[:max_length]

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        self.kept[api, slot, subslot, index] = data
        return None


@dataclass
class Pair:
    """A controller's AR and a device, every call and alarm frame between them carried at once."""

    controller: CmController
    device: CmDevice
    plugged: Plugged
    records: Memory
    now: int = SECOND
    ready: bool = True
    frames: bool = True
    events: list[CmctlEvent] = field(default_factory=list)
    device_events: list[device_events.CmEvent] = field(default_factory=list)

    def run(self) -> None:
        """Until nothing moves."""
        moved = True
        while moved:
            moved = self._carry_calls() | self._carry_ready() | self._carry_rta() | self._drain()

    def _carry_calls(self) -> bool:
        calls = self.controller.calls(self.now)
        for call in calls:
            self.device.receive_call(call.key, call.opnum, call.payload, call.args_maximum, CONTROLLER, self.now)
            for key, status, payload in self.device.responses():
                assert isinstance(key, int)
                assert len(payload) <= call.args_maximum
                self.controller.call_returned(key, status, payload, self.now)
        return bool(calls)

    def _carry_ready(self) -> bool:
        calls = self.device.calls()
        for call in calls:
            self.controller.receive_call(call.token, Opnum.CONTROL, call.payload, self.now)
            for key, status, payload in self.controller.responses():
                self.device.call_returned(key, status, payload, self.now)
        return bool(calls)

    def _carry_rta(self) -> bool:
        to_device, to_controller = self.controller.rta_to_send(), self.device.rta_to_send()
        for mac, pdu, _ in to_device:
            assert mac == DEVICE_MAC
            self.device.receive_rta(pdu, CONTROLLER_MAC, self.now)
        for frame in to_controller:
            assert frame.destination == CONTROLLER_MAC
            self.controller.receive_rta(frame.payload, DEVICE_MAC, self.now)
        return bool(to_device or to_controller)

    def _drain(self) -> bool:
        of_controller, of_device = self.controller.events(), self.device.events()
        self.events += of_controller
        self.device_events += of_device
        for event in of_device:
            if isinstance(event, device_events.ArConnected) and self.frames:
                self.device.data_received(event.ar_key, self.now)
            if isinstance(event, device_events.PrmEndReceived) and self.ready:
                self.device.application_ready(event.ar_key, self.now)
        return bool(of_controller or of_device)

    def start(self) -> None:
        self.controller.connect(self.now)
        self.run()

    def expire(self) -> None:
        """To the controller's next deadline."""
        deadline = self.controller.next_deadline()
        assert deadline is not None
        self.now = deadline
        self.controller.handle_timeout(self.now)
        self.run()


def pair(description: DeviceDescription = DRIVE, **changes: object) -> Pair:
    return pair_of(make_plan(**changes), description)


def pair_of(plan: ArPlan, description: DeviceDescription) -> Pair:
    plugged, records = Plugged(description), Memory()
    device = CmDevice(description, plugged, records, mac=DEVICE_MAC, station_name="axis-01", diagnosis=DiagnosisStore())
    return Pair(CmController(plan), device, plugged, records)


def device_fit_for(plan: ArPlan) -> DeviceDescription:
    """A device that has exactly what the plan expects."""
    modules: dict[int, list[SubmoduleDescription]] = {}
    for s in plan.submodules:
        modules.setdefault(s.slot, []).append(
            SubmoduleDescription(
                s.slot, s.subslot, s.api, s.module_ident, s.submodule_ident, s.input_bytes, s.output_bytes
            )
        )
    limits = Limits(strict=False, max_input_crs=plan.input_crs, max_output_crs=plan.output_crs)
    first, *rest = [ModuleDescription(slot, subs[0].module_ident, tuple(subs)) for slot, subs in modules.items()]
    return DeviceDescription(0x0105, 1, "any", first, IM0, tuple(rest), limits=limits)
