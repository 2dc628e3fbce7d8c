"""Each version of the GSDML schema: what its files say, what they leave out, and a connection to what they describe."""

import re

import pytest
from cmctl_pair import device_fit_for, pair_of
from cmctl_peers import make_plan
from gsdml_versions import VERSIONS, file_name, gsdml_of

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.controller.events import ArEstablished
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.versions import TABLE
from pnfarm.protocols.profinet.gsdml.versions import VERSIONS as KNOWN

WITHOUT_INTERFACE = {"1.0"}
WITHOUT_IDS = {"2.0", "2.1", "2.2"}
WITHOUT_PLUGGABLE = {"1.0", "2.0"}
WITHOUT_PLUGGABLE_PORTS = {*WITHOUT_PLUGGABLE, "2.1", "2.2"}
WITHOUT_START_UP = {"1.0", "2.0", "2.1", "2.2", "2.25"}
WITH_SHARED_RECORDS = {"2.44", "2.45"}
ALL = pytest.mark.parametrize("version", VERSIONS)


def read(version):
    return parse_gsdml(gsdml_of(version).encode())


def without(version, attribute, element, count=1):
    """The version's file with the attribute taken from the first of such elements; 0 for all."""
    text = gsdml_of(version)
    changed = re.sub(rf'(<{element} [^>]*?) ?\b{attribute}="[^"]*"', r"\1", text, count=count)
    assert changed != text
    return parse_gsdml(changed.encode())


def test_every_version_is_known():
    assert KNOWN == VERSIONS


# what the files say


@ALL
def test_the_file_of_each_version_says_who_and_what_the_device_is(version):
    gsdml = read(version)
    (dap,) = gsdml.daps
    assert (gsdml.schema_version, gsdml.remarks) == (f"V{version}", ())
    assert (gsdml.vendor_id, gsdml.device_id, gsdml.vendor_name) == (0xFEED, 0x0A1D, "Sample Works")
    assert (gsdml.main_family, gsdml.product_family) == ("Drives", "Servo")
    assert (dap.id, dap.ident, dap.slot, dap.instance, dap.min_device_interval) == ("Head", 0x10, 0, 1, 512)
    assert (dap.info.name, dap.info.order_number, list(dap.physical_slots)) == ("Sample servo", "SW-4711", [0, 1, 2, 3])
    assert (dap.ioxs_required, dap.max_record, dap.max_input) == (True, 4068, 100)
    assert gsdml.diagnoses[0].name == "Too hot"


@ALL
def test_interfaces_and_ports_are_read_with_ids_and_without(version):
    (dap,) = read(version).daps
    if version in WITHOUT_INTERFACE:
        assert (dap.interfaces, dap.ports) == ((), ())
        return
    (interface,), (port,) = dap.interfaces, dap.ports
    assert (interface.ident, interface.subslot, interface.name) == (2, 0x8000, "Interface")
    assert (port.ident, port.subslot, port.name) == (3, 0x8001, "Port")
    ids = ("", "") if version in WITHOUT_IDS else ("Interface", "Port")
    assert (interface.id, port.id) == ids
    assert interface.rt_classes == ("RT_CLASS_1",)
    assert interface.protocols == (() if version == "2.0" else ("SNMP", "LLDP"))
    assert list(port.mau_types) == ([16] if version in {"2.0", "2.1", "2.2", "2.25"} else [16, 30])


@ALL
def test_timings_and_start_up_are_found_where_the_version_has_them(version):
    (dap,) = read(version).daps
    relations = dap.relations
    assert (list(relations.send_clocks), list(relations.ratios)) == ([32, 64], [8, 16, 32])
    start_up = (("Legacy",), 1) if version in WITHOUT_START_UP else (("Advanced", "Legacy"), 2)
    assert (relations.startup_modes, relations.number_of_ars) == start_up
    assert relations.pull_module_alarm == (version not in {"1.0", "2.0", "2.1"})
    assert (dap.own_relations is None) == (version not in WITHOUT_INTERFACE)


@ALL
def test_what_a_version_does_not_have_is_left_to_its_default(version):
    (dap,) = read(version).daps
    assert dap.required_schema_version == "V1.0"
    multiple = version not in {"1.0", "2.0"}
    assert (dap.multiple_write, dap.address_assignment) == (multiple, ("DCP", "LOCAL") if multiple else ("DCP",))
    assert dap.device_access == (version not in {"1.0", "2.0", "2.1", "2.2"})
    assert dap.pnio_version == ("" if version in WITHOUT_START_UP else f"V{version}")
    assert list(dap.reset_modes) == ([] if version in WITHOUT_START_UP else [2])
    certified = version not in {*WITHOUT_START_UP, "2.3"}
    assert dap.check_device_id == certified
    assert (dap.certification is not None) == certified
    assert dap.device_access_ars == (0 if version in {*WITHOUT_START_UP, "2.3", "2.31", "2.32"} else 1)


@ALL
def test_modules_carry_their_submodules_lengths_and_places(version):
    gsdml = read(version)
    telegram = gsdml.module("T1")
    found = [(s.ident, s.api, list(s.fixed), s.input_octets, s.output_octets) for s in telegram.submodules]
    if version == "1.0":
        assert found == [(0x12, 0, [1], 4, 4)]
    else:
        assert found == [(0x11, 0x3A00, [1], 0, 0), (0x12, 0x3A00, [2], 4, 4)]
    assert all((s.iops_length, s.iocs_length) == (1, 1) for s in gsdml.all_submodules())
    assert (gsdml.module("Carrier") is None) == (version in WITHOUT_PLUGGABLE)
    assert [port.id for port in gsdml.pluggable_ports] == ([] if version in WITHOUT_PLUGGABLE_PORTS else ["Fibre"])


@ALL
def test_records_are_read_and_those_that_submodules_share(version):
    (signals,) = read(version).module("Signals").submodules
    records = [(record.index, record.transfer_sequence, record.octets().hex()) for record in signals.records]
    own, shared = (7, 0, "0100012c"), (8, 9, "0100012c")
    assert records == ([own, shared] if version in WITH_SHARED_RECORDS else [own])


# connections


@ALL
def test_a_controller_connects_to_the_device_that_the_file_describes(version):
    device = from_gsdml(read(version), modules={2: "Signals"})
    places = {(s.slot, s.subslot): (s.module_ident, s.submodule_ident, s.api, s.input_bytes, s.output_bytes)
              for s in device.submodules}  # fmt: skip
    expected = {(0, 1): (0x10, 1, 0, 0, 0), (2, 1): (0x30, 0x31, 0, 1, 0)}
    if version == "1.0":
        expected |= {(1, 1): (0x101, 0x12, 0, 4, 4)}
    else:
        expected |= {(0, 0x8000): (0x10, 2, 0, 0, 0), (0, 0x8001): (0x10, 3, 0, 0, 0)}
        expected |= {(1, 1): (0x101, 0x11, 0x3A00, 0, 0), (1, 2): (0x101, 0x12, 0x3A00, 4, 4)}
    assert places == expected
    assert device.startup() == "legacy"
    assert device.clock(32, 16) == (32, 16)
    plan = make_plan(
        vendor_id=device.vendor_id,
        device_id=device.device_id,
        instance=device.instance,
        submodules=device.submodules,
        records=device.records,
        multiple_write=device.multiple_write,
        startup=device.startup(),
        reduction_ratio=16,
    )
    both = pair_of(plan, device_fit_for(plan))
    both.start()
    assert any(isinstance(event, ArEstablished) for event in both.events)
    indices = [7, 8] if version in WITH_SHARED_RECORDS else [7]
    assert both.records.kept == {(0, 2, 1, index): bytes.fromhex("0100012c") for index in indices}


@pytest.mark.parametrize("version", [version for version in VERSIONS if version not in WITHOUT_PLUGGABLE])
def test_pluggable_submodules_are_planned_where_the_version_has_them(version):
    chosen = {(3, 2): "Counter"} if version in WITHOUT_PLUGGABLE_PORTS else {(3, 2): "Counter", (3, 3): "Fibre"}
    device = from_gsdml(read(version), modules={3: "Carrier"}, submodules=chosen)
    idents = {s.subslot: s.submodule_ident for s in device.submodules if s.slot == 3}
    assert idents == {2: 0x41} if version in WITHOUT_PLUGGABLE_PORTS else {2: 0x41, 3: 0x42}


# what a version asks for


@pytest.mark.parametrize(
    ("version", "element", "attribute"),
    [(version, "InterfaceSubmoduleItem", "ID") for version in VERSIONS[4:]]
    + [(version, "PortSubmoduleItem", "ID") for version in VERSIONS[4:]]
    + [(version, "DeviceAccessPointItem", "DeviceAccessSupported") for version in VERSIONS[4:]]
    + [(version, "DeviceAccessPointItem", "PNIO_Version") for version in VERSIONS[5:]]
    + [(version, "DeviceAccessPointItem", "CheckDeviceID_Allowed") for version in VERSIONS[6:]]
    + [(version, "VirtualSubmoduleItem", "MayIssueProcessAlarm") for version in VERSIONS[7:]]
    + [(version, "DeviceAccessPointItem", "DNS_CompatibleName") for version in VERSIONS],
)  # fmt: skip
def test_what_a_version_asks_for_and_no_device_needs_is_remarked_and_read_nevertheless(version, element, attribute):
    usual = read(version)
    gsdml = without(version, attribute, element)
    (remark,) = gsdml.remarks
    assert re.fullmatch(rf"line \d+: {element}/@{attribute} is missing; .* for it, .*", remark)
    assert from_gsdml(gsdml).submodules == from_gsdml(usual).submodules


def test_a_remark_names_the_first_line_how_many_more_there_are_and_the_version():
    (remark,) = without("2.35", "MayIssueProcessAlarm", "VirtualSubmoduleItem", count=0).remarks
    lines = gsdml_of("2.35").splitlines()
    first = next(number for number, line in enumerate(lines, 1) if "<VirtualSubmoduleItem" in line)
    assert remark.startswith(
        f"line {first}: VirtualSubmoduleItem/@MayIssueProcessAlarm is missing, and in 5 more; V2.32 and later ask"
    )


@pytest.mark.parametrize(
    ("version", "element", "attribute", "asking"),
    [("2.0", "PortSubmoduleItem", "SubslotNumber", "V2.0 and later ask for it"),
     ("2.45", "PortSubmoduleItem", "SubmoduleIdentNumber", "V2.0 and later ask for it"),
     ("2.2", "InterfaceSubmoduleItem", "SubmoduleIdentNumber", "V2.0 and later ask for it"),
     ("2.1", "SubmoduleItem", "ID", "V2.1 and later ask for it"),
     ("2.44", "ParameterRecordDataRef", "RecordDataTarget", "V2.44 and later ask for it"),
     ("1.0", "DeviceAccessPointItem", "MinDeviceInterval", "every version asks for it"),
     ("2.31", "DeviceAccessPointItem", "ID", "every version asks for it"),
     ("2.43", "ModuleItem", "ModuleIdentNumber", "every version asks for it"),
     ("2.25", "DataItem", "DataType", "every version asks for it")],
)  # fmt: skip
def test_what_nothing_works_without_is_refused_with_line_element_and_the_version(version, element, attribute, asking):
    with pytest.raises(DecodeError) as caught:
        without(version, attribute, element)
    assert re.match(rf"line \d+: {element}/@{attribute} is missing, allowed is a .*; {asking}", caught.value.detail)


def test_an_attribute_that_only_later_versions_have_counts_in_a_file_of_an_older_one():
    text = gsdml_of("2.0").replace(
        "<InterfaceSubmoduleItem ", '<InterfaceSubmoduleItem ID="I" SupportedProtocols="LLDP" '
    )
    (interface,) = parse_gsdml(text.encode()).daps[0].interfaces
    assert (interface.id, interface.protocols) == ("I", ("LLDP",))


@pytest.mark.parametrize(
    ("location", "name", "version"),
    [("GSDML-DeviceProfile-v2.31.xsd", "", "V2.31"),
     ("urn:x\n..\\xsd\\GSDML-DeviceProfile-V2.2.xsd", file_name("2.35"), "V2.2"),
     ("gsdml-deviceprofile-v2.25.XSD", "x.xml", "V2.25"),
     ("GSDML-DeviceProfile-v2.31.1.xsd", "", "V2.31"),
     ("GSDML-DeviceProfile.xsd", file_name("2.35"), "V2.35"),
     ("", "gsdml-v2.3-maker-block-20200101.xml", "V2.3"),
     ("", "block.xml", ""),
     ("GSDML-DeviceProfile-v3.1.xsd", "", "V3.1")],
)  # fmt: skip
def test_the_version_is_that_of_the_schema_else_that_of_the_files_name(location, name, version):
    text = gsdml_of("2.35").replace("..\\xsd\\GSDML-DeviceProfile-V2.35.xsd", location)
    assert parse_gsdml(text.encode(), name).schema_version == version


@pytest.mark.parametrize(
    ("location", "remarked"),
    [("x", False), ("GSDML-DeviceProfile-V2.3.xsd", False), ("GSDML-DeviceProfile-V9.9.xsd", True)],
)
def test_a_file_without_a_version_is_held_against_the_oldest_and_one_of_a_later_version_against_the_newest(
    location, remarked
):
    text = gsdml_of("2.45").replace("..\\xsd\\GSDML-DeviceProfile-V2.45.xsd", location)
    text = text.replace(' CheckDeviceID_Allowed="true"', "")
    assert bool(parse_gsdml(text.encode()).remarks) == remarked


# the table


def test_each_attribute_has_one_row_and_is_asked_for_by_no_version_that_does_not_have_it():
    assert len({(row.element, row.attribute) for row in TABLE}) == len(TABLE)
    for row in TABLE:
        assert row.since in VERSIONS, row
        assert not row.required or VERSIONS.index(row.since) <= VERSIONS.index(row.required), row


def test_a_row_has_a_default_or_a_reason_where_a_file_may_lack_what_its_version_asks_for():
    for row in TABLE:
        assert not (row.lenient and not row.required), row
        assert not (row.default and row.required and not row.lenient), row
