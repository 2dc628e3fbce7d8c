"""What the MSD's manual says of its slave, and what a drive makes of it: address, diagnosis, lamps, rates."""

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from manuals import manual_text

from pnfarm.buses.profibus.device.extended_diagnosis import extended_diagnosis, extended_octets
from pnfarm.buses.profibus.device.lamps import LampState, lamps
from pnfarm.buses.profibus.device.product import Product
from pnfarm.buses.profibus.device.station_address import StationAddress, station_address
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.parts import Fact
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.wire.dp import Diagnosis, StationStatus

DP = model("moog-msd-dp")
PRODUCT = Product.of(DP)


# 4.2.2: station address


@given(st.integers(0, 125), st.integers(0, 126))
def test_4_2_2_switches_up_to_125_are_the_address_whatever_the_parameter_says(switches, parameter):
    assert station_address(switches, parameter) == StationAddress(switches, "switches")


@given(st.integers(126, 0xFF), st.integers(0, 126))
def test_4_2_2_above_125_the_parameter_is_the_address(switches, parameter):
    assert station_address(switches, parameter) == StationAddress(parameter, "parameter")


def test_4_1_the_switches_are_two_digits_s2_before_s1():
    assert station_address(0x2A, 3).address == 42
    assert station_address(0x7D, 3).address == 125
    assert station_address(0x7E, 3).address == 3
    assert station_address(0xFF, 126).address == 126, "a drive as it comes waits at 126 for its address"


# 9.5.1: diagnosis


def test_table_9_21_a_fault_and_a_warning_fill_the_18_octets():
    error, warning = 1 << 16 | 11, 2 << 16 | 20
    extended = extended_diagnosis(PRODUCT, 1, error, warning)
    data = Diagnosis(StationStatus.ALWAYS_1 | StationStatus.EXT_DIAG, 1, 0x0A8E, extended).emit()
    assert len(data) == 18
    assert data[3:] == bytes.fromhex("01 0A8E 0C 81 00 00 0001 000B 0002 0014")
    (block,) = Diagnosis.parse(data).blocks()
    assert block.kind == "device"
    assert block.octets == extended


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_9_5_1_modes_1_to_3_send_the_block_of_the_length_in_its_first_octet(mode):
    extended = extended_diagnosis(PRODUCT, mode, 0, 0)
    assert len(extended) == extended[0] == extended_octets(PRODUCT) == 12
    assert extended[4:] == bytes(8), "neither fault nor warning"


@pytest.mark.parametrize("mode", [0, 4, 0xFFFF])
def test_9_5_1_other_modes_send_six_octets(mode):
    assert extended_diagnosis(PRODUCT, mode, 1 << 16 | 11, 0) == b""


def test_table_9_21_is_what_the_data_say():
    text = manual_text("003")
    assert "DPV1 header length of ext. data (12)" in text
    assert "DPV1 status type (0x81)" in text
    assert PRODUCT.diagnosis_header == (12, 0x81, 0, 0)
    assert "ERR_ErrorID = 0x0001000B" in text
    assert DP.fault("11-1").number == 0x0001000B


# 4.2.1: lamps

EXCHANGE = LampState(found=True, exchanged=True, exchanging=True)
WAITING = LampState(found=True)


@pytest.mark.parametrize(
    ("state", "h1", "h2", "h3"),
    [
        (LampState(powered=False, exchanging=True, found=True), "off", "off", "off"),
        (LampState(booting=True), "off", "on", "on"),
        (LampState(), "off", "off", "flashing"),
        (LampState(exchanged=True), "off", "flashing", "off"),
        (WAITING, "off", "off", "on"),
        (EXCHANGE, "on", "off", "off"),
        (replace(EXCHANGE, clear=True), "on", "off", "2 x flashes, pause"),
        (replace(EXCHANGE, class_two=True), "on", "off", "3 x flashes, pause"),
        (replace(EXCHANGE, clear=True, class_two=True), "on", "off", "2 x flashes, pause"),
        (replace(WAITING, parameters_wrong=True), "off", "2 x flashes, pause", "off"),
        (replace(WAITING, configuration_wrong=True), "off", "3 x flashes, pause", "off"),
        (replace(WAITING, class_two=True), "off", "off", "on"),
        (replace(EXCHANGE, parameters_wrong=True), "on", "off", "off"),
    ],
)
def test_table_4_2_lamps_by_state(state, h1, h2, h3):
    assert lamps(PRODUCT, state) == {"H1 yellow": h1, "H2 red": h2, "H3 green": h3}


def test_table_4_2_every_pattern_of_the_table_is_one_that_the_drive_shows():
    text = manual_text("003")
    part = text[text.index("2. Diagnostics on the operating state") : text.index("Table 4.2 The flashing")]
    rows = re.findall(r"(?m)^([A-Z0-9 x,*]+)\t([A-Z0-9 x,*]+)\t", part)
    printed = {(red.strip("* ").lower(), green.strip("* ").lower()) for red, green in rows}
    states = [
        PRODUCT.lamp_search, PRODUCT.lamp_search_again, PRODUCT.lamp_wait, PRODUCT.lamp_exchange, PRODUCT.lamp_clear,
        PRODUCT.lamp_parameters, PRODUCT.lamp_configuration, PRODUCT.lamp_class_2,
    ]  # fmt: skip
    assert len(rows) == 8
    assert printed == {(red, green) for _, red, green in states}


# baud rates


def test_17_2_every_rate_of_the_standard_up_to_12_mbaud_has_a_code_of_its_own():
    assert max(PRODUCT.baud_rates) == 12_000_000
    codes = [PRODUCT.baud_code(rate) for rate in PRODUCT.baud_rates]
    assert len(set(codes)) == len(codes) == 10
    # table 15.1: the range of P-0963 is from 9.6 to 45.45 kbit/s
    assert (PRODUCT.baud_code(9_600), PRODUCT.baud_code(45_450)) == (min(codes), max(codes))
    assert PRODUCT.baud_code(1234) == 0


# mistakes in the data


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("baud_rates", [9_601], r"\[profibus\] baud_rates = \[9601\] is not possible"),
        ("baud_codes", [0], "each of baud_rates needs its code"),
        ("longest_record", 241, "longest_record = 241 is not possible"),
        ("freeze", 1, "freeze = 1 is not possible"),
        ("lamp_wait", ["on"], "each state needs as many entries as there are lamp_names"),
        ("address_parameter", 9, "address_parameter: there is no parameter 9"),
        ("diagnosis_header", [256], "diagnosis_header = "),
        ("silence_ns", None, r"\[profibus\] has no silence_ns"),
    ],
)
def test_a_mistake_in_the_section_is_reported_with_its_key(key, value, message):
    facts = dict(DP.bus_facts)
    facts[key] = Fact(value, "test")
    if value is None:
        del facts[key]
    with pytest.raises(ConfigError, match=message):
        Product.of(replace(DP, bus_facts=facts))


@pytest.mark.parametrize(
    ("octets", "message"),
    [
        ("F1", "telegram 101 has 12 octets of outputs and 12 of inputs, its identifiers say 4 and 4"),
        ("F3 C0 C1", "telegram 101: its identifiers are cut off"),
    ],
)
def test_identifiers_that_do_not_have_the_lengths_of_their_telegram_are_reported(octets, message):
    telegrams = dict(DP.profidrive.telegrams)
    telegrams[101] = replace(telegrams[101], identifiers=bytes.fromhex(octets))
    described = replace(DP, profidrive=replace(DP.profidrive, telegrams=telegrams))
    with pytest.raises(ConfigError, match=message):
        Product.of(described)
