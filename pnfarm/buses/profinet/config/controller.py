"""The built-in PROFINET IO controller's section."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pnfarm.buses.profinet.config.clock import MAX_DATA_HOLD_FACTOR
from pnfarm.buses.profinet.config.device import CYCLES, Cycles, Place
from pnfarm.buses.profinet.config.values import Cycle
from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.ip import IpController
from pnfarm.config.section import Section
from pnfarm.config.values import Cidr, Duration, Gateway, Globs, NamePattern, OctetString, between

__all__ = ["DEFAULT_READY_NS", "ForeignDevice", "ParameterRecord", "ProfinetController"]

#: How long a device may take to be ready when neither the file nor its GSDML file gives it.
DEFAULT_READY_NS = 20_000_000_000

_U16 = 0xFFFF
_U32 = 0xFFFF_FFFF


class ParameterRecord(Section):
    """A record that is written before the end of parametrisation."""

    api: int = Field(default=0, ge=0, le=_U32, description="Application process identifier; PROFIdrive's is 0x3A00.")
    slot: int = Field(ge=0, le=0x7FFF, description="Slot of the submodule, a number.")
    subslot: int = Field(ge=1, le=0x9FFF, description="Subslot of the submodule, a number.")
    index: int = Field(ge=0, le=_U16, description="Record index, a number.")
    data: OctetString = Field(description="Octets in hexadecimal.")
    on: Globs | None = Field(default=None, description="Which drives; left out, all.")


class ForeignDevice(Section):
    """A device without a model, described by its maker's GSDML file."""

    name: NamePattern = Field(description="Its station name.")
    gsdml: str = Field(min_length=1, description="Its GSDML file, relative to this file.")
    dap: str | None = Field(
        default=None,
        description="ID, order number or name of the access point; left out if the GSDML file has only one.",
    )
    modules: dict[Place, str | None] = Field(
        default_factory=dict,
        description="Slot: ID, order number, name or ident of the module in it; null for an empty slot.",
        examples=[{1: "DI8"}],
    )
    submodules: dict[Place, dict[Place, str | None]] = Field(
        default_factory=dict, description="Slot: mapping of subslot to the submodule in it, in the same way."
    )
    ip: Cidr | None = Field(default=None, description="Its address; left out, the next free one of the controller's.")
    gateway: Gateway | None = Field(default=None, description="Router of the subnet.")
    cycle_ns: Cycle | None = Field(default=None, alias="cycle", description="Its cycle; left out, the controller's.")
    cycles: Cycles = CYCLES
    watchdog_factor: int | None = Field(
        default=None,
        ge=1,
        le=MAX_DATA_HOLD_FACTOR,
        description="Missed cycles until its connection is given up; left out, the controller's.",
    )
    startup: Literal["legacy", "advanced"] | None = Field(
        default=None, description="Start-up mode; left out, the controller's, or what the GSDML file allows."
    )


#: RemoteApplicationTimeout of a GSDML file counts seconds in 16 bits.
LEAST_READY_NS, MOST_READY_NS = 1_000_000_000, 65_535_000_000_000


ReadyTime = Annotated[Duration, between(LEAST_READY_NS, MOST_READY_NS, "1s to 65535s")]


class ProfinetController(IpController):
    """The built-in PROFINET IO controller."""

    last_keys: ClassVar[tuple[str, ...]] = ("program", "records", "devices", "reconnect")
    description_file: ClassVar[str] = "GSDML"

    cycle_ns: Cycle | None = Field(
        default=None,
        alias="cycle",
        description="Cycle of the IO data; left out, that of factor and ratio, or 16ms (a drive's slowest if that is "
        "faster, a device's fastest if that is slower).",
    )
    send_clock_factor: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = Field(
        default=None, description="Send clock in units of 31.25 us; left out, it follows from the cycle."
    )
    reduction_ratio: Literal[1, 2, 4, 8, 16, 32, 64, 128, 256, 512] | None = Field(
        default=None, description="Send clocks per frame; left out, it follows from the cycle."
    )
    watchdog_factor: int = Field(
        default=3, ge=1, le=MAX_DATA_HOLD_FACTOR, description="Missed cycles until the connection is given up."
    )
    startup: Literal["legacy", "advanced"] = Field(default="legacy", description="Start-up mode of the connection.")
    application_ready_ns: ReadyTime = Field(
        default=DEFAULT_READY_NS,
        alias="application_ready",
        description="How long a device may take from the end of parametrisation to ApplicationReady; left out, what "
        "its GSDML file names (RemoteApplicationTimeout), or 20s.",
    )
    assign_ip: bool = Field(default=True, description="Whether it gives the drives their addresses by DCP.")
    identification: bool = Field(default=True, description="Whether it reads I&M0 to I&M3 of connected drives.")
    takeover_allowed: bool = Field(default=False, description="Whether a supervisor may take submodules over.")
    telegram: int = Field(
        default=1, ge=0, le=_U16, description="Telegram of drives whose group names none; left out, their model's own."
    )
    records: list[ParameterRecord] = Field(default_factory=list)
    devices: list[ForeignDevice] = Field(
        default_factory=list, max_length=MAX_DRIVES, description="Further devices, each by its GSDML file."
    )
