"""User units of the Moog MSD (chapter 13), what one parameter does to another (11.4), texts of its errors (10.9)."""

from __future__ import annotations

import struct

import pytest
from drives_kit import Drive, new_drive

from pnfarm.drives.parameters.factor_group import float_bits, float_of
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.drives.profiles.profidrive.base_mode import parse_response
from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL, ParameterChannel


def bits(value: float) -> int:
    return int.from_bytes(struct.pack(">f", value), "big")


def example(drive: Drive) -> None:
    """Table 13.3: degrees, rev/min and rev/(min*s)."""
    for name, value in (
        ("P-0270", 65536),
        ("P-0271", 1),
        ("P-0272", 360),
        ("P-0274", bits(1)),
        ("P-0275", bits(1 / 60)),
    ):
        drive.store.set(name, value)


# 13.2


def test_13_2_a_reference_position_in_degrees_is_its_part_of_a_revolution(msd: Drive) -> None:
    """COM_DP_REFPos * MPRO_FG_Num / MPRO_FG_Den."""
    example(msd)
    assert msd.axis.travel.settings.position_step * 360 == pytest.approx(1.0)
    msd.store.set("P-0271", 5)
    msd.store.set("P-0272", 1000)
    assert msd.axis.travel.settings.position_step == pytest.approx(0.005), (
        "a gear or a feed constant is in the quotient"
    )


def test_13_2_a_positioning_speed_is_a_number_of_rev_per_minute(msd: Drive) -> None:
    """COM_DP_REFSpeed * MPRO_FG_SpeedFac; a tenth makes a place behind the point."""
    example(msd)
    assert (msd.axis.profidrive.settings.velocity_step, msd.axis.profidrive.settings.task_velocity_step) == (1.0, 1.0)
    msd.store.set("P-0274", bits(0.1))
    assert msd.axis.profidrive.settings.velocity_step == pytest.approx(0.1)
    assert msd.axis.profidrive.settings.task_velocity_step == pytest.approx(0.1)


def test_13_2_an_acceleration_of_the_example_is_one_rev_per_minute_and_second(msd: Drive) -> None:
    """COM_DP_ACC * MPRO_FG_AccFac, in rev/s2."""
    example(msd)
    msd.store.set("P-1278", 600)
    assert msd.axis.ramp.settings.acceleration == pytest.approx(600.0, rel=1e-6), "600 rev/(min*s)"
    assert msd.axis.profidrive.settings.acceleration_step == pytest.approx(1.0, rel=1e-6)


def test_values_written_before_the_factors_are_converted_when_they_change(msd: Drive) -> None:
    msd.store.set("P-1278", 100)
    msd.store.set("P-1268", 50)
    assert (msd.axis.ramp.settings.acceleration, msd.axis.jog.settings.velocity[0]) == (6000.0, 50.0)
    msd.store.set("P-0275", bits(0.5))
    msd.store.set("P-0274", bits(2.0))
    assert (msd.axis.ramp.settings.acceleration, msd.axis.jog.settings.velocity[0]) == (3000.0, 100.0)


def test_the_factors_are_kept_over_a_power_cycle(msd: Drive) -> None:
    example(msd)
    msd.store.set("P-0971", 1)
    msd.store.power_on()
    assert msd.axis.travel.settings.position_step * 360 == pytest.approx(1.0)
    assert msd.axis.profidrive.settings.acceleration_step == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("P-0271", 0), ("P-0272", 0), ("P-0274", bits(0.0)), ("P-0274", bits(-1.0)), ("P-0275", bits(float("inf"))),
        ("P-0275", bits(float("nan"))), ("P-0283", 3),
    ],
)  # fmt: skip
def test_a_factor_that_makes_a_unit_of_nothing_is_refused(msd: Drive, name: str, value: int) -> None:
    before = msd.store.get(name)
    with pytest.raises(ParameterError, match="limit exceeded"):
        msd.store.set(name, value)
    assert msd.store.get(name) == before


def test_units_and_exponents_are_for_display_alone(msd: Drive) -> None:
    """13.1."""
    before = (
        float(msd.axis.travel.settings.position_step),
        float(msd.axis.profidrive.settings.velocity_step),
        float(msd.axis.profidrive.settings.acceleration_step),
    )
    for name in ("P-0285", "P-0288", "P-0291", "P-0294"):
        msd.store.set(name, -3)
    for name in ("P-0284", "P-0287", "P-0290", "P-0293"):
        msd.store.set(name, ord("x"))
    assert before == (
        msd.axis.travel.settings.position_step,
        msd.axis.profidrive.settings.velocity_step,
        msd.axis.profidrive.settings.acceleration_step,
    )


def test_floats_are_their_bits_and_back() -> None:
    for value in (0.0, 1.0, -2.5, 1 / 3, 3.4e38):
        assert float_of(float_bits(value)) == pytest.approx(value)
    assert float_bits(1e300) == 0x7F800000
    assert float_bits(-1e300) == 0xFF800000
    assert float_of(0x3F800000) == 1.0


def test_table_14_2_the_current_is_read_as_a_float(msd: Drive) -> None:
    msd.axis.motor.current = -1.25
    assert float_of(msd.store.get("P-0700")) == -1.25


# 11.4


@pytest.mark.parametrize("element", [0, 1, 2, 3])
def test_11_4_a_touch_probe_as_reference_mark_sets_what_it_records(element: int) -> None:
    for probe in (1, 2):
        drive = new_drive("moog-msd")
        drive.store.set(f"P-1255.{element}", probe)
        assert drive.store.read(1402, 0, 2) == [probe == 1, probe == 2]
        assert drive.axis.sensor.settings.marks[element] == probe


def test_11_4_edges_and_reserved_elements_set_nothing(msd: Drive) -> None:
    msd.store.write(1255, 4, [1, 1, 1, 1, 2, 2, 2, 2])
    assert msd.store.read(1402, 0, 2) == [0, 0]
    assert list(msd.axis.sensor.settings.marks) == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2]


# 11.3


def test_11_3_p_0979_describes_the_encoder_that_the_position_values_count_in(msd: Drive) -> None:
    """Tables 11.1 to 11.4."""
    header, kind, resolution, shift_1, shift_2, revolutions, *rest = msd.store.read(979, 0, 32)
    assert header == 0x00005111
    assert (header & 0xF, header >> 4 & 0xF, header >> 8 & 0xF, header >> 12 & 0xF) == (1, 1, 1, 5)
    assert kind == 0x80000000, "rotary, and the data are valid"
    assert (resolution, shift_1, shift_2, revolutions) == (1048576, 0, 0, 4096)
    assert not any(rest)
    assert resolution << shift_1 == 1 / msd.axis.sensor.settings.step
    assert resolution << shift_2 == 1 / msd.axis.sensor.settings.step_2
    assert resolution * revolutions == 1 << 32, "12 bits of revolutions above 20 of pulses"
    with pytest.raises(ParameterError, match="cannot be changed"):
        msd.store.set("P-0979.1", 0)


# 10.9


def texts(drive: Drive, subindex: int, elements: int) -> bytes:
    channel = ParameterChannel(drive.store, LOCAL)
    channel.write_request(bytes([1, 1, 0, 1, 0x30, elements]) + struct.pack(">HH", 951, subindex))
    response = channel.read_response()
    assert response is not None
    (entry,) = parse_response(response).entries
    return bytes([entry.format]) + bytes(value & 0xFF for value in entry.values)


def test_10_9_the_texts_of_the_error_numbers_are_read_as_texts(msd: Drive) -> None:
    """Table 10.22: 16 characters of each."""
    assert texts(msd, 9, 1) == b"\x09Fieldbus system "
    assert texts(msd, 17, 3) == b"\x09Technology      Engineering     Other errors    "
    assert len(texts(msd, 0, 14)) == 1 + 14 * 16


@pytest.mark.parametrize(("subindex", "elements", "error"), [(20, 1, 0x03), (18, 3, 0x03), (0, 15, 0x15)])
def test_10_9_texts_that_are_not_there_or_too_many_are_refused(
    msd: Drive, subindex: int, elements: int, error: int
) -> None:
    answer = texts(msd, subindex, elements)
    assert (answer[0], answer[1]) == (0x44, error)


def test_10_9_p_0951_says_in_its_description_that_it_has_texts(msd: Drive) -> None:
    found = {}
    for pnu in (951, 947):
        channel = ParameterChannel(msd.store, LOCAL)
        channel.write_request(bytes([1, 1, 0, 1, 0x20, 1]) + struct.pack(">HH", pnu, 1))
        response = channel.read_response()
        assert response is not None
        found[pnu] = response[6] << 8 | response[7]
    assert found[951] & 0x0400
    assert not found[947] & 0x0400
