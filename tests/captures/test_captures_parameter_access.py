"""Values of parameter access in a capture: as numbers and texts that their formats, or the model, make of them."""

from __future__ import annotations

import struct

import pytest

from pnfarm.captures.parameter_access import parameter_request, parameter_response
from pnfarm.drives.catalogue import model
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_TEXT,
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_VISIBLE_STRING,
    FORMAT_WORD,
    REQUEST_CHANGE,
    REQUEST_READ,
    ParameterAddress,
    ParameterRequest,
    ParameterResponse,
    ParameterValues,
    emit_request,
    emit_response,
)

MSD = model("moog-msd")
(ONE_AND_A_HALF,) = struct.unpack(">I", struct.pack(">f", 1.5))
SIGNED, FLOAT, TEXT = (
    next(one for one in MSD.parameters.values() if one.octets == octets and kind(one))
    for octets, kind in (
        (2, lambda one: one.signed), (4, lambda one: one.form.value == "float"), (1, lambda one: one.text),
    )
)  # fmt: skip
INTEGER_16, FLOATING_POINT = 0x03, 0x08


def answered(address: ParameterAddress, entry: ParameterValues, known: bool) -> str:
    asked = emit_request(ParameterRequest(1, REQUEST_READ, 1, (address,)))
    answer = emit_response(ParameterResponse(1, REQUEST_READ, 1, 1, (entry,)))
    return parameter_response(answer, asked, MSD if known else None).partition("= ")[2]


@pytest.mark.parametrize(
    ("address", "entry", "known", "shown"),
    [
        (ParameterAddress(SIGNED.pnu), ParameterValues(INTEGER_16, (0xFFFB,)), False, "-5"),
        (ParameterAddress(SIGNED.pnu), ParameterValues(FORMAT_WORD, (0xFFFB,)), False, "65531"),
        (ParameterAddress(SIGNED.pnu), ParameterValues(FORMAT_WORD, (0xFFFB,)), True, "-5"),
        (ParameterAddress(FLOAT.pnu), ParameterValues(FLOATING_POINT, (ONE_AND_A_HALF,)), False, "1.5"),
        (ParameterAddress(FLOAT.pnu), ParameterValues(FORMAT_DWORD, (ONE_AND_A_HALF,)), True, "1.5"),
        (ParameterAddress(TEXT.pnu, 0, 4), ParameterValues(FORMAT_BYTE, tuple(b"MSD\0")), True, "'MSD'"),
        (ParameterAddress(1, 0, 0, ATTRIBUTE_TEXT), ParameterValues(FORMAT_VISIBLE_STRING, (65, 66)), False, "'AB'"),
    ],
)
def test_a_value_is_what_its_format_or_the_model_says(address, entry, known, shown):
    assert answered(address, entry, known) == shown


def test_a_value_that_is_written_is_shown_alike():
    address, entry = ParameterAddress(SIGNED.pnu), ParameterValues(FORMAT_WORD, (0xFFFB,))
    change = emit_request(ParameterRequest(1, REQUEST_CHANGE, 1, (address,), (entry,)))
    assert parameter_request(change, MSD).endswith(" = -5")
