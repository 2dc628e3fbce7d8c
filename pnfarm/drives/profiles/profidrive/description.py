"""The description of a parameter: attribute 0x20 of a request (PROFIdrive profile 4.1, 6.2.1.3).

Twelve elements in 46 octets; subindex 0 asks for all of them, 1..12 for one.

==  =======================  ======  =====================================================
 n  element                  octets  here
==  =======================  ======  =====================================================
 1  identifier               2       bits below, data type in bits 0..7
 2  number of elements       2       0 for a parameter that is no array, the length of a text
 3  standardisation factor   4       as a float, 1.0 where the number is the value itself or it does not matter
 4  variable attribute       2       0
 5  reserved                 4       0
 6  name                     16      ASCII, filled with blanks
 7  low limit                4
 8  high limit               4
 9  reserved                 2       0
10  identifier extension     2       0
11  PZD reference parameter  2       0
12  PZD normalisation        2       0
==  =======================  ======  =====================================================
"""

from __future__ import annotations

from pnfarm.drives.parameters.parameter import Form, Parameter, ParameterError, ParameterErrorNumber, ParameterType
from pnfarm.drives.profiles.profidrive.base_mode import FORMAT_BYTE, FORMAT_DWORD, FORMAT_WORD
from pnfarm.wire.octets import Writer

__all__ = ["data_type", "describe", "format_of"]

ID_ARRAY = 1 << 14
ID_ONLY_RESET = 1 << 13
ID_CHANGED = 1 << 12
ID_TEXTS = 1 << 10
ID_NOT_WRITABLE = 1 << 9
ID_FACTOR_IRRELEVANT = 1 << 8
#: Data types Integer8..32 and Unsigned8..32 by (signed, octets).
_DATA_TYPES = {(True, 1): 0x02, (True, 2): 0x03, (True, 4): 0x04, (False, 1): 0x05, (False, 2): 0x06, (False, 4): 0x07}
_FORMATS = {1: FORMAT_BYTE, 2: FORMAT_WORD, 4: FORMAT_DWORD}
FLOATING_POINT = 0x08
VISIBLE_STRING = 0x09
#: The finite numbers of single precision.
LOWEST_FLOAT, HIGHEST_FLOAT = 0xFF7FFFFF, 0x7F7FFFFF
_WIDTHS = (2, 2, 4, 2, 4, 16, 4, 4, 2, 2, 2, 2)


def data_type(parameter: Parameter) -> int:
    """Bits 0 to 7 of the identifier (Moog MSD manual, table 8.17)."""
    forms = {Form.FLOAT: FLOATING_POINT, Form.TEXT: VISIBLE_STRING}
    return forms.get(parameter.form) or _DATA_TYPES[parameter.signed, parameter.octets]


def format_of(parameter: Parameter, *, typed: bool = False) -> int:
    """The format in which a parameter's values travel: byte, word or double word (AKD PROFINET manual 5.6).

    ``typed``: by its data type (HIWIN E1 manual 4.3.5: integers with or without a sign; profile 6.2.3.4: all types).
    """
    return data_type(parameter) if typed else _FORMATS[parameter.octets]


def describe(parameter: Parameter, element: int, *, changed: bool, texts: bool = False) -> bytes:
    """The octets of one element, of all for element 0; raises :class:`ParameterError` (faulty subindex).

    ``changed``: the value differs from the factory's; ``texts``: its elements have texts.
    """
    if not 0 <= element <= len(_WIDTHS):
        raise ParameterError(ParameterErrorNumber.FAULTY_SUBINDEX, element)
    identifier = data_type(parameter)
    identifier |= ID_ARRAY if parameter.elements and not parameter.text else 0
    identifier |= ID_ONLY_RESET if parameter.only_reset else 0
    identifier |= ID_CHANGED if changed else 0
    identifier |= ID_TEXTS if texts else 0
    identifier |= 0 if parameter.writable else ID_NOT_WRITABLE
    # a matter of the type (Moog MSD manual, table 8.16, bit 8): nothing is calculated of a text, nor of a command
    identifier |= ID_FACTOR_IRRELEVANT if parameter.text or parameter.type is ParameterType.COMMAND else 0
    name = parameter.name.encode("ascii", "replace")[:16].ljust(16)
    writer = Writer()
    writer.u16(identifier).u16(parameter.elements).f32(parameter.standardisation).u16(0).u32(0).bytes(name)
    low, high = parameter.minimum, parameter.maximum
    if parameter.form is Form.FLOAT and (low, high) == (parameter.lowest, parameter.highest):
        low, high = LOWEST_FLOAT, HIGHEST_FLOAT
    writer.u32(low & 0xFFFFFFFF).u32(high & 0xFFFFFFFF).zeros(8)
    octets: bytes = writer.getvalue()
    if element == 0:
        return octets
    start = sum(_WIDTHS[: element - 1])
    return octets[start : start + _WIDTHS[element - 1]]
