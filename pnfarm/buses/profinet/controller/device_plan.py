"""What the controller expects of each device, and of itself."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal

from pnfarm.buses.controllers.device_plan import IpPlan, PlannedDevice
from pnfarm.buses.controllers.signal_steps import SignalSteps
from pnfarm.protocols.profinet.cm.controller.plan import APPLICATION_READY_NS, ArPlan
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.buses.plain_layout import PlainLayout
    from pnfarm.protocols.profinet.cm.controller.plan import ParameterRecord, PlannedSubmodule
    from pnfarm.protocols.profinet.gsdml.texts import DescribedDiagnosis

__all__ = ["CALL_PORT", "DevicePlan", "PlannedAxis", "ProfinetPlan"]


#: UDP port of the controller's own calls.
CALL_PORT = 49_153


@dataclass(frozen=True, slots=True, kw_only=True)
class DevicePlan(PlannedDevice):
    """One drive as the controller expects it."""

    ip: IPv4Interface
    gateway: IPv4Address | None
    assign_ip: bool
    vendor_id: int
    device_id: int
    submodules: tuple[PlannedSubmodule, ...]
    steps: SignalSteps = field(default_factory=SignalSteps)
    send_clock_factor: int
    reduction_ratio: int
    #: CRs of each direction that its submodules need.
    input_crs: int = 1
    output_crs: int = 1
    watchdog_factor: int
    startup: Literal["legacy", "advanced"]
    records: tuple[ParameterRecord, ...]
    instance: int = 1
    multiple_write: bool = False
    #: Longest time from the end of parametrisation to ApplicationReady.
    application_ready_ns: int = APPLICATION_READY_NS
    #: Whether I&M0 to I&M3 are read once the connection is established.
    read_identification: bool = True
    #: The one that is expected, empty for any.
    serial_number: str = ""
    #: ``ArType.IOSAR``: the controller is a supervisor, which takes submodules over where that is allowed.
    ar_type: int = ArType.IOCAR_SINGLE
    #: A supervisor may take submodules over.
    takeover_allowed: bool = False
    #: The device's own texts for its diagnoses.
    texts: DescribedDiagnosis | None = None
    #: Where the outputs and the inputs of a device without axes are in its rows of plain data; None: it has axes.
    plain: tuple[PlainLayout, PlainLayout] | None = None
    #: About the file that describes the device.
    remarks: tuple[str, ...] = ()

    @property
    def cycle_ns(self) -> int:
        return self.send_clock_factor * self.reduction_ratio * SEND_CLOCK_NS

    @property
    def channels(self) -> int:
        return len(self.further) + max(self.input_crs, self.output_crs)

    def access_point(self, axis: str) -> tuple[int, int, int]:
        """API, slot and subslot of an axis' parameter access, by the axis' name or the drive's."""
        slots = next((one.slots for name, one in self.axes if name == axis), None)
        own = (one for one in self.submodules if one.slot and (slots is None or one.slot in slots))
        return min((one.api, one.slot, one.subslot) for one in own)

    def ar_plan(self, **own: Any) -> ArPlan:
        """What its AR is asked for: fields of the same names, and the controller's ``own``."""
        same = {one.name for one in fields(self)} & {one.name for one in fields(ArPlan)}
        return ArPlan(**{name: getattr(self, name) for name in same} | own)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedAxis(PlannedDevice):
    """An axis after the first one of a drive."""

    cycle_ns: int


@dataclass(frozen=True, slots=True)
class ProfinetPlan(IpPlan):
    """One controller and its devices."""

    devices: Sequence[DevicePlan]

    @property
    def udp_ports(self) -> tuple[IPv4Interface, Sequence[int]]:
        return self.ip, (RPC_PORT, CALL_PORT)
