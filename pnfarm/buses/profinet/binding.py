"""Binds PROFINET to the drive: the model as a device description, parameter records.

The only file of this protocol that depends on drives.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from pnfarm.buses.profinet.axis_slots import axis_shifts
from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.description import (
    MAX_REDUCTION,
    DeviceDescription,
    Im0Description,
    Limits,
    ModuleDescription,
    SubmoduleDescription,
)
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.wire.rtc import REDUCTION_RATIOS, SEND_CLOCK_FACTORS, SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pnfarm.buses.profinet.described.records import DescribedRecords
    from pnfarm.config.drive import AxisConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.drives.telegrams.telegram import Module, Submodule
    from pnfarm.protocols.profinet.cm.ar import Ar

__all__ = [
    "EVERY_RATIO", "AxisPlace", "DriveRecords", "axis_places", "describe_device", "serial_number",
]  # fmt: skip

#: A drive with lax limits accepts every defined SendClockFactor and ReductionRatio.
EVERY_RATIO = range(1, MAX_REDUCTION + 1)


class AxisPlace(NamedTuple):
    """An axis at power-on: its telegram, None for the model's, and a supplementary one, None for none.

    ``shift``: how far after the model's its slots are.
    """

    shift: int = 0
    telegram: int | None = None
    supplementary: int | None = None


def axis_places(model: Model, axes: Sequence[AxisConfig]) -> list[AxisPlace]:
    """The axes of a drive in the farm file."""
    shifts = axis_shifts(model, [axis.slot for axis in axes])
    return [AxisPlace(shift, axis.telegram, axis.supplementary) for shift, axis in zip(shifts, axes, strict=True)]


_MODEL_AXIS = AxisPlace()

#: I&M1 to I&M3, which every device must store since V2.31 of the specification, and I&M4, which is optional.  Assumed:
#: no manual mentions them, and an engineering tool that writes a signature must be able to read it back.
_IM_SUPPORTED = 0b11110


def serial_number(mac: bytes) -> str:
    """16 characters at most, unique because derived from the MAC address."""
    return f"PNF{mac.hex().upper()}"


@lru_cache(1024)
def _module(module: Module, shift: int = 0) -> ModuleDescription:
    """``shift``: so many slots further.  All drives of a model share it."""
    return ModuleDescription(
        slot=module.slot + shift,
        module_ident=module.ident,
        submodules=tuple(_submodule(s, module.ident, shift) for s in module.submodules),
        choices=tuple(_submodule(s, module.ident, shift) for s in module.choices),
    )


def _submodule(own: Submodule, module_ident: int, shift: int) -> SubmoduleDescription:
    return SubmoduleDescription(
        slot=own.slot + shift,
        subslot=own.subslot,
        api=own.api,
        module_ident=module_ident,
        submodule_ident=own.ident,
        input_bytes=own.input_bytes,
        output_bytes=own.output_bytes,
        name=own.name,
    )


def _timing(model: Model) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Send clocks and reduction ratios that give a cycle within the model's slowest one."""
    clocks, longest = model.limits.send_clocks, model.limits.max_cycle_ns // SEND_CLOCK_NS
    if not longest:
        return clocks, REDUCTION_RATIOS
    return (
        tuple(clock for clock in clocks if clock <= longest),
        tuple(ratio for ratio in REDUCTION_RATIOS if min(clocks) * ratio <= longest),
    )


def _axis_modules(model: Model, axis: AxisPlace) -> Iterator[ModuleDescription]:
    """The modules that the slots of an axis can have; that of its telegram first, with its supplementary one."""
    first = model.profidrive.default_telegram if axis.telegram is None else axis.telegram
    supplement = None if axis.supplementary is None else model.profidrive.supplements[axis.supplementary].module.data
    seen: set[tuple[int, int]] = set()
    for each in sorted(model.profidrive.telegrams, key=lambda known: known != first):
        for module in model.profidrive.telegrams[each].modules:
            if (module.slot, module.ident) in seen:
                continue
            found = _module(module, axis.shift)
            if supplement is not None and not seen:
                found = found.taking({supplement.subslot: supplement.ident})
            seen.add((module.slot, module.ident))
            yield found


def describe_device(
    model: Model, mac: bytes, *, strict: bool, axes: Sequence[AxisPlace] = (_MODEL_AXIS,)
) -> DeviceDescription:
    """A drive's device description; the telegrams of ``axes`` are plugged at first."""
    identity = model.profidrive.identity
    prefix, version = identity.software_prefix, identity.software_version
    clocks, ratios = _timing(model) if strict else (SEND_CLOCK_FACTORS, EVERY_RATIO)
    return DeviceDescription(
        vendor_id=identity.vendor_id,
        device_id=identity.device_id,
        station_type=identity.station_type,
        dap=_module(model.dap),
        modules=tuple(module for axis in axes for module in _axis_modules(model, axis)),
        min_device_interval=model.limits.min_cycle_ns // SEND_CLOCK_NS if strict else 1,
        send_clocks=clocks,
        reduction_ratios=ratios,
        im0=Im0Description(
            order_id=identity.order_id,
            serial_number=serial_number(mac),
            hardware_revision=identity.hardware_revision,
            software_revision=(prefix, *version),
            profile_id=identity.profile_id,
            profile_specific_type=identity.profile_specific_type,
            im_supported=_IM_SUPPORTED,
        ),
        limits=Limits(
            strict=strict,
            min_cycle_ns=model.limits.min_cycle_ns if strict else 0,
            max_cycle_ns=model.limits.max_cycle_ns if strict else 0,
            max_ars=model.limits.io_controllers,
        ),
    )


def _client(ar: Ar | None) -> int:
    """The client of a parameter channel: 0 for a read without a connection."""
    return 0 if ar is None else ar.key


class DriveRecords:
    """The drive's own records (a ``RecordHandler``): base mode parameter access, and those of its maker's file.

    Parameter access is at the parameter access points, which are any submodules of the axes' slots in the profile's
    API; index 47 is the AKD's, 0xB02E and 0xB02F the profile's.  ``axes`` has the number of the axis, from 0, of each
    slot.  ``latency`` gives the time that the next request takes, ns.  ``further`` are the file's, None without one.
    ``error``, when set, refuses every access; ``withhold``, when set, is called with the time at each read of a ready
    response; if it returns true, the drive is still busy.
    """

    def __init__(
        self,
        stores: Sequence[ParameterStore],
        axes: Mapping[int, int],
        api: int,
        *,
        strict: bool = True,
        latency: Callable[[], int] | None = None,
        further: DescribedRecords | None = None,
    ) -> None:
        indexes = stores[0].model.access.record_indexes
        first, *others = stores
        self.channels = {
            index: ParameterChannel(first, index, further=others, strict=strict, latency=latency) for index in indexes
        }
        self.further = further
        self.error: RecordError | None = None
        self.withhold: Callable[[int], bool] | None = None
        self._axes = axes
        self._api = api

    def reset(self, key: int) -> None:
        """The connection of this key ended: discard its pending responses."""
        for channel in self.channels.values():
            channel.reset(key)

    def next_deadline(self) -> int | None:
        """When a request is to be carried out."""
        return earliest(*self.channels.values())

    def handle_timeout(self, now: int) -> None:
        for channel in self.channels.values():
            channel.handle_timeout(now)

    def _channel(self, api: int, slot: int, index: int) -> ParameterChannel | DescribedRecords | RecordError:
        if self.error is not None:
            return self.error
        channel = self.channels.get(index)
        here = slot in self._axes and api == self._api
        if channel is not None and here:
            return channel
        if self.further is not None:
            return self.further
        return RecordError(AccessError.INVALID_INDEX if channel is None else AccessError.INVALID_SLOT_SUBSLOT)

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """The response of this connection at this submodule; without a ready one the access is a state conflict."""
        channel = self._channel(api, slot, index)
        if isinstance(channel, RecordError):
            return channel
        if not isinstance(channel, ParameterChannel):
            channel.withhold = self.withhold
            return channel.read(ar, api, slot, subslot, index, max_length, now)
        channel.handle_timeout(now)
        client, place = _client(ar), (slot, subslot)
        if self.withhold is not None and channel.pending(client, place) and self.withhold(now):
            return RecordError(AccessError.STATE_CONFLICT)
        response = channel.read_response(max_length, client, now, place)
        return RecordError(AccessError.STATE_CONFLICT) if response is None else response

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        """Take a parameter request; errors inside it are reported by its response."""
        channel = self._channel(api, slot, index)
        if isinstance(channel, RecordError):
            return channel
        if not isinstance(channel, ParameterChannel):
            return channel.write(ar, api, slot, subslot, index, data, now)
        try:
            taken = channel.write_request(data, _client(ar), now, self._axes[slot], (slot, subslot))
        except DecodeError:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        return None if taken else RecordError(AccessError.STATE_CONFLICT)
