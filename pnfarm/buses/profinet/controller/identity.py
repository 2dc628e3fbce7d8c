"""A drive's data in I&M0 to I&M4 (PI profile guideline 1)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.records.identification import Im0, ImText

__all__ = ["Identification", "read_im", "revision_text"]

#: I&M1: 32 octets of function, then 22 of location.
_FUNCTION = 32


@dataclass(frozen=True, slots=True)
class Identification:
    """``im_supported`` has bit n for I&M n; the texts of records that a drive does not have are empty.

    ``signature`` is hexadecimal, without the zeros at its end.
    """

    vendor_id: int
    order_id: str
    serial_number: str
    hardware_revision: int
    software_revision: str
    revision_counter: int
    profile_id: int
    profile_specific_type: int
    im_supported: int
    tag_function: str = ""
    tag_location: str = ""
    installation_date: str = ""
    descriptor: str = ""
    signature: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def revision_text(revision: tuple[str, int, int, int]) -> str:
    """``V1.17.0``."""
    prefix, *numbers = revision
    return prefix + ".".join(map(str, numbers))


def _text(octets: bytes) -> str:
    return octets.decode("latin-1").rstrip("\0 ")


def read_im(before: Identification | None, data: bytes) -> Identification:
    """Add one of I&M0 to I&M4 to what is known; I&M0 comes first.  Raises DecodeError."""
    blocks = split_blocks(data)
    if not blocks:
        raise DecodeError("bad-count", "an I&M record without a block")
    block = blocks[0]
    if block.block_type == BlockType.IM0:
        im0 = Im0.of(block)
        return Identification(
            vendor_id=im0.vendor_id,
            order_id=_text(im0.order_id),
            serial_number=_text(im0.serial_number),
            hardware_revision=im0.hardware_revision,
            software_revision=revision_text(im0.software_revision),
            revision_counter=im0.revision_counter,
            profile_id=im0.profile_id,
            profile_specific_type=im0.profile_specific_type,
            im_supported=im0.im_supported,
        )
    if before is None:
        raise DecodeError("bad-type", f"block 0x{block.block_type:04X} before I&M0")
    text = ImText.of(block)
    match text.block_type:
        case BlockType.IM1:
            function, location = _text(text.text[:_FUNCTION]), _text(text.text[_FUNCTION:])
            return replace(before, tag_function=function, tag_location=location)
        case BlockType.IM2:
            return replace(before, installation_date=_text(text.text))
        case BlockType.IM3:
            return replace(before, descriptor=_text(text.text))
        case BlockType.IM4:
            return replace(before, signature=text.text.rstrip(b"\0").hex())
    return before
