import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.wire.names import check_station_name


@pytest.mark.parametrize(
    "name",
    [
        "a", "0", "axis-01", "line1.cell2.axis-03", "x" * 63, ".".join(["x" * 63] * 3 + ["y" * 48]), "1.2.3",
        "1.2.3.4.5", "1.2.3.4a", "1234.1.1.1", "port-1", "port-abc", "port-001x", "port-001-1234", "my-port-001",
        "xn--mnchen-3ya", "io-devicexb15b32", "device-1.machine-1.plant-1.vendor", "0-9", "axis.port-001", "port-0001",
        "xn--mhle1-kva.xn--lmhle1-vxa4c.plant.com", "xn--a--yka", "xn", "999.1.1", "1.1.1.1000",
    ],
)  # fmt: skip
def test_a_good_name_is_accepted(name):
    assert check_station_name(name) is None


@pytest.mark.parametrize(
    ("name", "because"),
    [
        ("", "empty"),
        ("x" * 64, "at most 63"),
        (".".join(["x" * 60] * 4), "at most 240"),
        ("Axis", "other characters"),
        ("axis_1", "other characters"),
        ("axis 1", "other characters"),
        ("äxis", "other characters"),
        ("axis\n", "other characters"),
        ("axis.", "label is empty"),
        (".axis", "label is empty"),
        ("a..b", "label is empty"),
        ("-axis", "begins or ends"),
        ("a.-axis", "begins or ends"),
        ("axis-", "begins or ends"),
        ("axis-.b", "begins or ends"),
        ("a--b", "two '-'"),
        ("ab--c", "two '-'"),
        ("xn-a--b", "two '-'"),
        ("xn--a--b", "not Punycode"),
        ("xn--axis", "not Punycode"),
        ("xn--a-b1", "not Punycode"),
        ("xn--999999999", "not Punycode"),
        ("cell.xn--" + "9" * 59, "not Punycode"),
        ("xn--", "begins or ends"),
        ("xn--Mnchen-3ya", "other characters"),
        ("port-001", "name of a port"),
        ("port-001.axis", "name of a port"),
        ("port-001-12345", "name of a port"),
        ("port-000", "name of a port"),
        ("port-999-99999.a.b", "name of a port"),
        (".", "label is empty"),
        ("-", "begins or ends"),
        ("1.2.3.4", "IP address"),
        ("10.0.0.1", "IP address"),
        ("000.00.0.999", "IP address"),
        ("999.0.0.1", "IP address"),
    ],
)
def test_a_bad_name_is_refused_with_the_reason(name, because):
    assert because in check_station_name(name)


@given(st.text() | st.from_regex(r"xn--[a-z0-9-]{1,59}", fullmatch=True))
def test_every_accepted_name_fits_on_the_wire(name):
    if check_station_name(name) is None:
        assert 1 <= len(name.encode("ascii")) <= 240
        assert name == name.lower()
