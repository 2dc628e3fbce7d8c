"""A group of devices on PROFINET, each by its GSDML file, and one device of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from pnfarm.buses.profinet.config.values import WANTED, Cycle, Wanted
from pnfarm.config.ip import IpDeviceConfig, IpDevices
from pnfarm.config.section import Section
from pnfarm.config.slots import slot_number
from pnfarm.config.values import Scalar

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.profinet.described.station import DescribedStation

__all__ = ["Place", "PluggedModule", "ProfinetDeviceConfig", "ProfinetDevices"]

_U16 = 0xFFFF

#: A slot or a subslot as the key of a mapping.
Place = Annotated[int, *slot_number("a slot or subslot", _U16)]
#: Slot: cycle of its data.
Cycles = dict[Place, Cycle]
CYCLES: Any = Field(
    default_factory=dict,
    description="Slot: cycle of its module's data at the built-in controller, if that is another one. Each cycle has "
    "frames of its own, as far as the GSDML file allows (NumberOfAdditionalInputCR, NumberOfAdditionalOutputCR).",
    examples=[{2: "64ms"}],
)


class PluggedModule(Section):
    """What is in a slot."""

    module: Wanted | None = Field(default=None, description=f"{WANTED} of the module; left out, what its file fixes.")
    submodules: dict[Place, Wanted | None] = Field(
        default_factory=dict, description=f"Subslot: {WANTED} of the submodule in it; null for an empty one."
    )
    parameters: dict[str, Scalar] = Field(
        default_factory=dict,
        description="Its parameters by the names of its file: the values that it has, and that the built-in controller "
        "writes. `1.5/NAME` (subslot, index) where several have that name.",
        examples=[{"substitute": "hold"}],
    )


def _open_module(value: Any) -> Any:
    return value if value is None or isinstance(value, (dict, PluggedModule)) else {"module": value}


SlotSetting = Annotated[
    PluggedModule | None, BeforeValidator(_open_module, json_schema_input_type=str | int | PluggedModule | None)
]


class ProfinetDevices(IpDevices):
    """Keys of a group on PROFINET."""

    first_keys: ClassVar[tuple[str, ...]] = (
        "name",
        "count",
        "start",
        "gsdml",
        "access_point",
        "ip",
        "gateway",
        "mac",
        "slots",
    )

    gsdml: str = Field(
        min_length=1,
        max_length=4096,
        description="Its maker's GSDML file, relative to this file: a device on PROFINET.",
    )
    access_point: Wanted | None = Field(
        default=None, description=f"{WANTED} of the access point; left out if the GSDML file has only one."
    )
    slots: dict[Place, SlotSetting] = Field(
        default_factory=dict,
        description=f"Slot: {WANTED} of the module in it, or a mapping with module, submodules and parameters; null "
        "for an empty slot. Modules that the file fixes or plugs at first need not be named.",
        examples=[{1: "16DI", 2: {"module": "8DO", "parameters": {"substitute": "hold"}}}],
    )
    hello: bool = Field(
        default=False,
        description="Whether the device sends DCP Hello at power-on; a controller's fast start-up record overrides it.",
    )
    cycle_ns: Cycle | None = Field(
        default=None, alias="cycle", description="Cycle at which the built-in controller runs these devices."
    )
    cycles: Cycles = CYCLES


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfinetDeviceConfig(IpDeviceConfig):
    """One device; ``cycle_ns`` is None where the controller's counts, ``cycles`` has those of slots with another."""

    described: DescribedStation
    hello: bool = False
    cycle_ns: int | None = None
    cycles: Mapping[int, int] = field(default_factory=dict)

    @property
    def known_signals(self) -> Mapping[str, Any]:
        return self.described.signals

    def addresses(self) -> Sequence[str]:
        mac, ip = IpDeviceConfig.addresses(self)
        return mac, ip or "by DCP"
