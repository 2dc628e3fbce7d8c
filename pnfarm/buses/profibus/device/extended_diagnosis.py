"""What a drive reports of its fault after the first six octets of a diagnosis.

A model with a ``diagnosis_parameter`` has a status block of DP-V1 (Moog MSD manual 9.5.1, table 9.21), any other the
error of a channel with the profile's fault class (SINAMICS S120 function manual, drive functions, 11/2017, 11.1:
identifier-related and channel-related diagnostics).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pnfarm.buses.profibus.device.product import Product

__all__ = ["channel_diagnosis", "channel_error", "extended_diagnosis", "extended_octets"]

#: ERR_ErrorID and ERR_WRN_State.
_NUMBER_OCTETS = 4
#: Identifier-related, and the first identifier has a diagnosis; channel-related of it, input and output, no channel.
_CHANNEL: Final = bytes((0x42, 0x01, 0x80, 0xC0))
#: ChannelErrorTypes of the profile, from 0x9000 on, as PROFIBUS has them: its manufacturers' range is smaller.
_FIRST_CLASS: Final = 0x9000
_ERRORS: Final = (16, 17, 2, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 17, 29, 30, 31, 9, 9)
#: Those for which no class is known.
_ERROR: Final = 9


def extended_diagnosis(product: Product, mode: int, error: int, warning: int) -> bytes:
    """The status block of DP-V1: header, error, warning; empty where ``mode`` (P-1256) asks for none.

    ``error``: number in the lower word, location in the upper one, 0 without a fault (error 11, location 1 is
    0x0001000B); ``warning`` likewise.  Both fit in four octets.
    """
    if mode not in product.diagnosis_modes:
        return b""
    numbers = (number.to_bytes(_NUMBER_OCTETS, "big") for number in (error, warning))
    return bytes(product.diagnosis_header) + b"".join(numbers)


def channel_error(error_type: int) -> int:
    """The error of a channel, 1 to 31, for a ChannelErrorType of PROFINET."""
    place = error_type - _FIRST_CLASS
    return _ERRORS[place] if 0 <= place < len(_ERRORS) else _ERROR


def channel_diagnosis(error_type: int | None) -> bytes:
    """Blocks of the identifier and of the channel, empty without an error."""
    return b"" if error_type is None else _CHANNEL + bytes((channel_error(error_type),))


def extended_octets(product: Product) -> int:
    """The length of the longest."""
    if product.diagnosis_parameter is None:
        return len(_CHANNEL) + 1
    return len(product.diagnosis_header) + 2 * _NUMBER_OCTETS
