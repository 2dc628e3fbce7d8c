"""Binds PROFINET to the drive: the model as a device description, telegrams as words of a frame, parameter records.

The only file of this protocol that depends on drives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.description import (
    MAX_REDUCTION,
    REDUCTION_RATIOS,
    DeviceDescription,
    Im0Description,
    Limits,
    ModuleDescription,
    SubmoduleDescription,
)
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.drives.telegrams.telegram import Module
    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey, IocrLayout

__all__ = ["ChannelLayout", "DriveRecords", "channel_layout", "describe_device", "serial_number"]

#: A drive with lax limits accepts every defined SendClockFactor and ReductionRatio.
_EVERY_SEND_CLOCK = (1, 2, 4, 8, 16, 32, 64, 128)
_EVERY_RATIO = range(1, MAX_REDUCTION + 1)


#: I&M1 to I&M3, which every device must store since V2.31 of the specification, and I&M4, which is optional.  Assumed:
#: no manual mentions them, and an engineering tool that writes a signature must be able to read it back.
_IM_SUPPORTED = 0b11110


def serial_number(mac: bytes) -> str:
    """16 characters at most, unique because derived from the MAC address."""
    return f"PNF{mac.hex().upper()}"


def _module(module: Module) -> ModuleDescription:
    return ModuleDescription(
        slot=module.slot,
        module_ident=module.ident,
        submodules=tuple(
            SubmoduleDescription(
                slot=s.slot,
                subslot=s.subslot,
                api=s.api,
                module_ident=module.ident,
                submodule_ident=s.ident,
                input_bytes=s.input_bytes,
                output_bytes=s.output_bytes,
            )
            for s in module.submodules
        ),
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


def describe_device(model: Model, mac: bytes, *, strict: bool, telegram: int | None = None) -> DeviceDescription:
    """This drive's device description; ``telegram`` is plugged at first, default that of the model."""
    first = model.profidrive.default_telegram if telegram is None else telegram
    order = sorted(model.profidrive.telegrams, key=lambda number: number != first)
    identity = model.profidrive.identity
    prefix, version = identity.software_prefix, identity.software_version
    clocks, ratios = _timing(model) if strict else (_EVERY_SEND_CLOCK, _EVERY_RATIO)
    return DeviceDescription(
        vendor_id=identity.vendor_id,
        device_id=identity.device_id,
        station_type=identity.station_type,
        dap=_module(model.dap),
        modules=tuple(_module(module) for number in order for module in model.profidrive.telegrams[number].modules),
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


@dataclass(frozen=True, slots=True)
class ChannelLayout:
    """One frame in the engine's form; offsets count from the first octet of IO data.

    ``words``: (code, offset); ``iops``: provider status of submodules with telegram words; ``constants``: (offset,
    octet) of all other status octets.
    """

    words: tuple[tuple[int, int], ...]
    iops: tuple[int, ...]
    constants: tuple[tuple[int, int], ...]


def channel_layout(layout: IocrLayout, words: Sequence[int], unusable: Container[ExpectedKey]) -> ChannelLayout:
    """Place the telegram's ``words`` in the frame of ``layout``, in the order of its submodules with data.

    A submodule that the device does not have (``unusable``) carries no word and BAD status, unless its status octets
    are discarded.
    """
    placed: list[tuple[int, int]] = []
    iops: list[int] = []
    constants: list[tuple[int, int]] = []
    waiting = list(words)
    for place in sorted(layout.data, key=lambda d: (d.slot, d.subslot)):
        key = (place.api, place.slot, place.subslot)
        if key in unusable or not place.data_length:
            if place.iops_offset is not None:
                constants.append((place.iops_offset, IOXS_BAD if key in unusable else IOXS_GOOD))
            continue
        if place.iops_offset is not None:
            iops.append(place.iops_offset)
        for offset in range(place.data_offset, place.data_offset + place.data_length - 1, 2):
            if not waiting:
                break
            placed.append((waiting.pop(0), offset))
    for status in layout.iocs:
        if status.iocs_offset is None:
            continue
        good = (status.api, status.slot, status.subslot) not in unusable
        constants.append((status.iocs_offset, IOXS_GOOD if good else IOXS_BAD))
    return ChannelLayout(tuple(placed), tuple(iops), tuple(constants))


def _client(ar: Ar | None) -> int:
    """The client of a parameter channel: 0 for a read without a connection."""
    return 0 if ar is None else ar.key


class DriveRecords:
    """The drive's own records (a ``RecordHandler``): base mode parameter access, and nothing else.

    They belong to the parameter access point, which is any submodule of the drive's slot in the profile's API; index
    47 is the AKD's, 0xB02E and 0xB02F the profile's.  ``latency`` gives the time that the next request takes, ns.
    ``error``, when set, refuses every access; ``withhold``, when set, is called with the time at each read of a ready
    response; if it returns true, the drive is still busy.
    """

    def __init__(
        self,
        store: ParameterStore,
        slot: int,
        api: int,
        *,
        strict: bool = True,
        latency: Callable[[], int] | None = None,
    ) -> None:
        indexes = store.model.access.record_indexes
        self.channels = {index: ParameterChannel(store, index, strict=strict, latency=latency) for index in indexes}
        self.error: RecordError | None = None
        self.withhold: Callable[[int], bool] | None = None
        self._slot = slot
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

    def _channel(self, api: int, slot: int, index: int) -> ParameterChannel | RecordError:
        if self.error is not None:
            return self.error
        channel = self.channels.get(index)
        if channel is None:
            return RecordError(AccessError.INVALID_INDEX)
        if slot != self._slot or api != self._api:
            return RecordError(AccessError.INVALID_SLOT_SUBSLOT)
        return channel

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """The response of this connection; without a ready response the access is a state conflict."""
        del subslot
        channel = self._channel(api, slot, index)
        if isinstance(channel, RecordError):
            return channel
        channel.handle_timeout(now)
        if self.withhold is not None and channel.pending(_client(ar)) and self.withhold(now):
            return RecordError(AccessError.STATE_CONFLICT)
        response = channel.read_response(max_length, _client(ar), now)
        return RecordError(AccessError.STATE_CONFLICT) if response is None else response

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        """Take a parameter request; errors inside it are reported by its response."""
        del subslot
        channel = self._channel(api, slot, index)
        if isinstance(channel, RecordError):
            return channel
        try:
            taken = channel.write_request(data, _client(ar), now)
        except DecodeError:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        return None if taken else RecordError(AccessError.STATE_CONFLICT)
