"""A group of devices on PROFIBUS, each by its GSD file, and one device of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from pnfarm.buses.profibus.config.drive import Address  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.config.device import DeviceConfig, DeviceGroup
from pnfarm.config.section import Section
from pnfarm.config.slots import named_module, slot_number
from pnfarm.config.values import Scalar

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.profibus.described.station import DescribedSlave
    from pnfarm.config.drive import Claim

__all__ = ["GsdModule", "ProfibusDeviceConfig", "ProfibusDevices"]

#: Identifiers of Chk_Cfg: no slave has more slots.
_MOST_SLOTS = 244
_NAMED = "name or number"

Slot = Annotated[int, *slot_number("a slot", _MOST_SLOTS)]
NamedModule = Annotated[str | int, *named_module(_NAMED)]


class GsdModule(Section):
    """What is in a slot."""

    module: NamedModule | None = Field(
        default=None, description=f"{_NAMED.capitalize()} of the module; left out, what its file fixes."
    )
    parameters: dict[str, Scalar] = Field(
        default_factory=dict,
        description="Its parameters by the names of its file: the values that the built-in controller sends in "
        "Set_Prm. `3/NAME` or `3.1/NAME` (octet, bit) where several have that name.",
        examples=[{"Substitute": "hold"}],
    )


def _open_module(value: Any) -> Any:
    return value if value is None or isinstance(value, (dict, GsdModule)) else {"module": value}


SlotSetting = Annotated[
    GsdModule | None, BeforeValidator(_open_module, json_schema_input_type=str | int | GsdModule | None)
]


class ProfibusDevices(DeviceGroup):
    """Keys of a group on PROFIBUS."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "count", "start", "gsd", "address", "slots")

    gsd: str = Field(
        min_length=1, max_length=4096, description="Its maker's GSD file, relative to this file: a device on PROFIBUS."
    )
    address: Address | None = Field(
        default=None,
        description="Station address of the first device; counts up. Left out, a master sets it, where the file "
        "permits that (Set_Slave_Add_supp).",
    )
    slots: dict[Slot, SlotSetting] = Field(
        default_factory=dict,
        description=f"On PROFIBUS: slot, from 1: {_NAMED} of the module in it, or a mapping with module and "
        "parameters; null for an empty slot. Modules that the file fixes need not be named. Slot 0, with parameters "
        "only, is the station.",
        examples=[
            {
                0: {"parameters": {"Diagnosis": "on"}},
                1: "16DI",
                2: {"module": "8DO", "parameters": {"Substitute": "hold"}},
            }
        ],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfibusDeviceConfig(DeviceConfig):
    """One device; ``address`` is None until a master sets one."""

    described: DescribedSlave
    address: int | None

    @property
    def known_signals(self) -> Mapping[str, Any]:
        return self.described.signals

    def claims(self) -> Sequence[Claim]:
        if self.address is None:
            return ()
        return (("address", ("profibus", self.address), f"station address {self.address}"),)

    def addresses(self) -> Sequence[str]:
        """Its station address, as far as the file says it."""
        return "", "by Set_Slave_Add" if self.address is None else str(self.address)
