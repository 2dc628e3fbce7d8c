"""What the scanner expects of each device, and of itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.controllers.device_plan import IpPlan, PlannedDevice
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, NetworkParameters, TransportClass

if TYPE_CHECKING:
    from collections.abc import Sequence
    from ipaddress import IPv4Interface

    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = ["ConnectionPlan", "DevicePlan", "EthernetIpPlan", "ProgramSteps"]

#: The longest size of a small Forward_Open, octets.
LONGEST_SMALL = 511
#: Sequence count, and run/idle header, octets.
COUNT, HEADER = 2, 4


@dataclass(frozen=True, slots=True)
class ConnectionPlan:
    """The cyclic connection that a device is asked for.

    ``path`` is the connection path with its electronic key and configuration; octets are those of data alone, and a
    direction without data has a heartbeat, which never has a header.  ``*_variable``: the device has no fixed size.
    """

    kind: str
    path: bytes
    output_octets: int
    input_octets: int
    output_header: bool
    input_header: bool
    multicast: bool
    output_variable: bool = False
    input_variable: bool = False

    @property
    def output_size(self) -> int:
        """As Forward_Open has it."""
        return COUNT + self.output_octets + HEADER * self.runs

    @property
    def input_size(self) -> int:
        return COUNT + self.input_octets + HEADER * self.input_header

    @property
    def runs(self) -> bool:
        """Whether what is sent has the run/idle header."""
        return self.output_header and self.output_octets > 0

    @property
    def large(self) -> bool:
        """Whether it needs a Large_Forward_Open."""
        return max(self.output_size, self.input_size) > LONGEST_SMALL

    @property
    def output(self) -> NetworkParameters:
        return NetworkParameters(self.output_size, ConnectionType.POINT_TO_POINT, variable=self.output_variable)

    @property
    def input(self) -> NetworkParameters:
        kind = ConnectionType.MULTICAST if self.multicast else ConnectionType.POINT_TO_POINT
        return NetworkParameters(self.input_size, kind, variable=self.input_variable)

    @property
    def transport(self) -> TransportClass:
        return TransportClass(1)


@dataclass(frozen=True, slots=True)
class ProgramSteps:
    """What the axis program needs to know of a drive; names as in the program's row.

    ``velocity_step`` rpm, ``ramp_step`` rpm/s and ``target_step`` rev are one unit of the commands.
    """

    front: int = 0
    velocity_step: float = 1.0
    ramp_step: float = 1.0
    target_step: float = 1.0
    speed_up: float = 0.0
    speed_down: float = 0.0
    clear_number: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DevicePlan(PlannedDevice):
    """One device as the scanner expects it; an assembly is no telegram, so that a user's program has no signals."""

    ip: IPv4Interface
    connection: ConnectionPlan
    rpi_ns: int
    timeout_multiplier: int
    steps: ProgramSteps = ProgramSteps()
    request_timeout_ns: int
    #: Identity as the file or the model has it; numbers of 0 are not compared.
    key: ElectronicKey

    @property
    def plain(self) -> bool:
        """Whether its data are plain: no model says what they are."""
        return self.described is None

    @property
    def cycle_ns(self) -> int:
        return self.rpi_ns


@dataclass(frozen=True, slots=True)
class EthernetIpPlan(IpPlan):
    """One scanner and its devices."""

    devices: Sequence[DevicePlan]
