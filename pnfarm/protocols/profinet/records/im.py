"""Identification and maintenance: I&M0 to I&M4 and their carriers (PI profile guideline 1; IEC 61158-6-10).

I&M0 is the description's.  The texts of I&M1 to I&M4 are written by engineering and belong in non-volatile memory:
:class:`ImRecords` keeps them in a mapping that it is given.
A submodule without I&M data of its own answers with its module's carrier, or with the device's; only
carriers can be written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.records.identification import (
    IM_TEXT_SIZES,
    IdentificationApi,
    IdentificationData,
    IdentificationSlot,
    Im0,
    ImText,
)

if TYPE_CHECKING:
    from collections.abc import Callable, MutableMapping

    from pnfarm.protocols.profinet.description import DeviceDescription, Im0Description, ImCarrier, Plugged

__all__ = ["ImRecords", "TextKey", "im0_of"]

#: (slot, subslot, index) of a carrier's I&M1 to I&M4.
TextKey = tuple[int, int, int]

_FILTER_VERSION = 0x0100
_VISIBLE = range(0x20, 0x7F)


def im0_of(description: DeviceDescription, im0: Im0Description | None = None) -> Im0:
    """I&M0 of the device, or of a part of it with an ``im0`` of its own."""
    own = im0 if im0 is not None else description.im0
    return Im0(
        vendor_id=description.vendor_id,
        order_id=own.order_id.encode("ascii", "replace").ljust(20)[:20],
        serial_number=own.serial_number.encode("ascii", "replace").ljust(16)[:16],
        hardware_revision=own.hardware_revision,
        software_revision=own.software_revision,
        revision_counter=own.revision_counter,
        profile_id=own.profile_id,
        profile_specific_type=own.profile_specific_type,
        im_supported=own.im_supported,
    )


class ImRecords:
    """The I&M records of one device.  ``texts`` outlives it: it is read at each access and changed in place."""

    def __init__(self, description: DeviceDescription, plugged: Plugged, texts: MutableMapping[TextKey, bytes]) -> None:
        self.texts = texts
        self._description = description
        self._plugged = plugged
        self._written = False
        #: Whether what is written can be kept.
        self.can_keep: Callable[[], bool] = lambda: True

    def take_written(self) -> bool:
        """Whether a text was written since the last call: save them."""
        written, self._written = self._written, False
        return written

    def read(self, slot: int, subslot: int, index: int) -> bytes | RecordError:
        """I&M0 to I&M4 of a submodule that exists."""
        carrier = self._carrier(slot, subslot)
        if carrier is None:
            return RecordError(AccessError.INVALID_INDEX)
        if index == Index.IM0:
            return im0_of(self._description, carrier.im0).emit()
        block = self._block(carrier, index)
        if block is None:
            return RecordError(AccessError.INVALID_INDEX)
        size = IM_TEXT_SIZES[block]
        # a text is padded with blanks, the signature is octets
        padding = b"\0" if block is BlockType.IM4 else b" "
        text = self.texts.get((carrier.slot, carrier.subslot, index), b"")
        return ImText(block, text.ljust(size, padding)[:size]).emit()

    def write(self, slot: int, subslot: int, index: int, data: bytes) -> RecordError | None:
        """I&M1 to I&M4.  Texts are visible characters; zeros after them count as padding."""
        carrier = self._carrier(slot, subslot)
        block = self._block(carrier, index) if carrier is not None else None
        if carrier is None or block is None:
            return RecordError(AccessError.INVALID_INDEX)
        if (carrier.slot, carrier.subslot) != (slot, subslot):
            return RecordError(AccessError.ACCESS_DENIED)
        try:
            (raw,) = split_blocks(data)
            value = ImText.of(raw)
        except (DecodeError, ValueError):
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        if value.block_type != block:
            return RecordError(AccessError.INVALID_PARAMETER)
        text = value.text
        if block is not BlockType.IM4:
            text = text.rstrip(b"\0").ljust(len(text))
            if not all(octet in _VISIBLE for octet in text):
                return RecordError(AccessError.INVALID_PARAMETER)
        if not self.can_keep():
            return RecordError(AccessError.STATE_CONFLICT)
        self.texts[slot, subslot, index] = text
        self._written = True
        return None

    def filter_data(self) -> bytes:
        """I&M0FilterData: all carriers, those that represent their module, those that represent the device."""
        carriers = [c for c in self._description.carriers if (c.slot, c.subslot) in self._plugged]
        return (
            self._filter(BlockType.IM0_FILTER_DATA_SUBMODULE, carriers, lambda _: True)
            + self._filter(BlockType.IM0_FILTER_DATA_MODULE, carriers, lambda c: c.module)
            + self._filter(BlockType.IM0_FILTER_DATA_DEVICE, carriers, lambda c: c.device)
        )

    def _filter(self, block: BlockType, carriers: list[ImCarrier], wanted: Callable[[ImCarrier], bool]) -> bytes:
        apis: dict[int, dict[int, list[tuple[int, int]]]] = {}
        for carrier in filter(wanted, carriers):
            sub = self._plugged[carrier.slot, carrier.subslot]
            apis.setdefault(sub.api, {}).setdefault(sub.slot, []).append((sub.subslot, sub.submodule_ident))
        if not apis:
            return b""
        data = tuple(
            IdentificationApi(
                api, tuple(IdentificationSlot(slot, self._ident(slot), tuple(subs)) for slot, subs in slots.items())
            )
            for api, slots in sorted(apis.items())
        )
        return IdentificationData(block, data, _FILTER_VERSION).emit()

    def _ident(self, slot: int) -> int:
        module = self._plugged.module(slot)
        return module.module_ident if module else 0

    def _carrier(self, slot: int, subslot: int) -> ImCarrier | None:
        """The carrier whose I&M data the submodule answers with: its own, its module's, or the device's."""
        carriers = self._description.carriers
        return (
            next((c for c in carriers if (c.slot, c.subslot) == (slot, subslot)), None)
            or next((c for c in carriers if c.module and c.slot == slot), None)
            or next((c for c in carriers if c.device), None)
        )

    def _block(self, carrier: ImCarrier, index: int) -> BlockType | None:
        """The block of I&M1 to I&M4, when the carrier supports it."""
        number = index - Index.IM0
        supported = (carrier.im0 or self._description.im0).im_supported
        return BlockType(BlockType.IM0 + number) if supported >> number & 1 else None
