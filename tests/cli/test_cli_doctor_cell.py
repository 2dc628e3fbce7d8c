"""`pnfarm doctor FILE`: whether a PLC with this farm will be green, by the file alone and by the PLC's project."""

import json
import shutil
import socket
from ipaddress import IPv4Address

import l5x_project
import pytest
from aml_project import ISLAND, at_system, drive, module, plc, project, slave, station
from device_cell import CONFIGS
from device_cell import ISLAND as ISLAND_FILE

from pnfarm.buses.ethernetip.eds_file import load_eds
from pnfarm.cli import cell_doctor
from pnfarm.cli.cell_doctor import examine_cell, own_addresses
from pnfarm.cli.farm_file import read

HEAD = "farm: line\nlink: {kind: memory}\napi: off\n"
DI16, DO8, AI4 = (f"GSD:{ISLAND}/M/{name}" for name in ("DI16", "DO8", "AI4"))


def farm(tmp_path, text, head=HEAD):
    file = tmp_path / "line.pnfarm.yml"
    file.write_text(head + text, "utf-8")
    return file


def found(tmp_path, text, head=HEAD):
    return {one.name: one for one in examine_cell(read(farm(tmp_path, text, head)))}


AXES = "drives:\n  - {name: 'axis-{n}', count: 2, model: akd-profinet, ip: 10.0.0.11/24}\n"


def test_a_file_without_faults_has_a_finding_for_each_subject(tmp_path):
    findings = found(tmp_path, AXES + "controller: {name: plc, ip: 10.0.0.1/24}\n")
    assert {name: one.ok for name, one in findings.items()} == {"names": True, "addresses": True, "controller": True}
    assert findings["controller"].detail == "its plan has 2 stations"


def test_names_that_differ_in_case_alone_are_told_with_their_line(tmp_path):
    text = (
        "drives:\n  - {name: axis-a, model: akd-ethernetip, ip: 10.0.0.11/24}\n"
        "  - {name: Axis-A, model: akd-ethernetip, ip: 10.0.0.12/24}\n"
    )
    finding = found(tmp_path, text)["names"]
    assert (finding.ok, finding.line) == (None, 6)
    assert "Axis-A and axis-a differ only in case" in finding.detail


def test_an_address_of_this_machine_and_one_behind_a_router_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(cell_doctor, "own_addresses", lambda: {IPv4Address("10.0.0.12"): "eth1"})
    head = HEAD.replace("memory", "macvlan, parent: eth1")
    finding = found(tmp_path, AXES, head)["addresses"]
    assert (finding.ok, finding.keeps_red, finding.line) == (False, True, 5)
    assert "10.0.0.12 of axis-2 is this machine's own, at eth1" in finding.detail
    # in memory nobody else can have it
    assert found(tmp_path, AXES)["addresses"].ok
    other = "  - {name: far, model: akd-profinet, ip: 10.9.0.1/24, gateway: 10.9.0.254}\n"
    finding = found(tmp_path, AXES + other)["addresses"]
    assert (finding.ok, finding.line) == (None, 6)
    assert "far: in 10.9.0.0/24, and not in the first station's 10.0.0.0/24" in finding.detail


def test_the_loopback_address_is_this_machine_s():
    assert own_addresses()[IPv4Address("127.0.0.1")] == socket.if_indextoname(1)


def test_a_plan_that_the_built_in_controller_cannot_make_keeps_a_plc_from_being_green(tmp_path, pnfarm):
    file = farm(tmp_path, AXES + "controller: {name: plc, ip: 10.0.0.1/24, devices: [{name: x, gsdml: none.xml}]}\n")
    done = pnfarm("doctor", file, "--format", "json")
    findings = {one["name"]: one for one in json.loads(done.out)["findings"]}
    assert not findings["controller"]["ok"]
    assert findings["controller"]["line"] == 6
    assert "none.xml" in findings["controller"]["detail"]


# -- with the PLC's project


def island(name="island", ip="10.0.0.41", *modules):
    plugged = modules or (module(1, DI16), module(2, DO8))
    return station(name, ip, f"GSD:{ISLAND}/DAP/DAP 1", *plugged, kind=f"GSD:{ISLAND}/D")


def device(name="island", ip="10.0.0.41", slots="{1: 16DI, 2: 8DO}"):
    return f"devices:\n  - {{name: {name}, gsdml: {ISLAND}, access_point: DAP 1, ip: {ip}/24, slots: {slots}}}\n"


@pytest.fixture
def judged(tmp_path, pnfarm, monkeypatch):
    """Findings about the stations of a farm file beside a project."""
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    shutil.copy(CONFIGS / ISLAND_FILE, tmp_path / ISLAND)

    def run(text, *stations, **options):
        links = [at_system("island-if")]
        (tmp_path / "line.aml").write_text(project(plc(), *stations, links=links, **options))
        done = pnfarm("doctor", farm(tmp_path, text), "--project", tmp_path / "line.aml", "--format", "json")
        assert done.out, done.err
        return done.code, {one["name"]: one for one in json.loads(done.out)["findings"]}

    return run


def test_a_station_as_in_the_project_will_be_green(judged):
    code, findings = judged(device(), island())
    assert (findings["island"]["ok"], code) == (True, 0)
    assert findings["island"]["detail"].startswith("will be green")
    assert findings["island"]["line"] == 5


def test_an_address_that_the_plc_assigns_does_not_keep_it_from_being_green(judged):
    code, findings = judged(device(ip="10.0.0.77"), island())
    assert (findings["island"]["ok"], code) == (True, 0)
    assert "the PLC gives it 10.0.0.41" in findings["island"]["detail"]


def test_another_module_another_name_and_a_station_that_is_not_played_stay_red(judged):
    code, findings = judged(device(slots="{1: 16DI, 2: EX-AI-4}"), island())
    assert (findings["island"]["ok"], findings["island"]["keeps_red"], code) == (False, True, 1)
    assert "slot 2: the project has 0x" in findings["island"]["detail"]
    assert "what the project has there, 0x" in findings["island"]["remedy"]
    code, findings = judged(device(slots="{1: 16DI}"), island())
    assert "the file nothing" in findings["island"]["detail"]
    code, findings = judged(device("other"), island())
    assert (code, findings["island"]["remedy"], findings["island"]["line"]) == (1, "name: island", 5)
    code, findings = judged(AXES, island())
    assert (code, findings["island"]["ok"]) == (1, False)
    assert "the farm does not have it" in findings["island"]["detail"]
    assert (findings["axis-1"]["ok"], findings["axis-1"]["line"]) == (None, 5)
    assert "no PLC connects to it" in findings["axis-1"]["detail"]


def test_what_the_project_does_not_say_is_not_called_green(judged):
    unknown = module(3, f"GSD:{ISLAND}/M/NEW")
    code, findings = judged(device(), island("island", "10.0.0.41", module(1, DI16), module(2, DO8), unknown))
    assert (findings["island"]["ok"], code) == (None, 0)
    assert "the file has no module 'NEW'" in findings["island"]["detail"]
    foreign = drive("other", "10.0.0.51", file="GSDML-V2.35-NOBODY-X-20240101.xml")
    code, findings = judged(device(), island(), foreign)
    assert findings["island"]["ok"]
    assert findings["other"]["ok"] is None
    assert "GSDML-V2.35-NOBODY-X-20240101.xml" in findings["other"]["detail"]
    assert findings["other"]["remedy"]


def test_on_ethernetip_the_assemblies_and_the_identity_count_where_the_plc_compares_it(tmp_path, pnfarm, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    eds = CONFIGS / "eds" / "Example-Weigher-20261128.eds"
    key = load_eds(eds).key
    own = f"devices:\n  - {{name: scale, eds: {eds}, ip: 192.168.1.20/24}}\n"
    numbers = {"Vendor": key.vendor_id, "ProductType": key.device_type, "ProductCode": key.product_code}

    def judge(text, *modules):
        (tmp_path / "line.L5X").write_text(l5x_project.project(*modules))
        done = pnfarm("doctor", farm(tmp_path, text), "--project", tmp_path / "line.L5X", "--format", "json")
        findings = {one["name"]: one for one in json.loads(done.out)["findings"]}
        return done.code, findings["scale"]

    # a generic module without keying, of other assemblies, then of those that the file has
    other = l5x_project.module("scale", "192.168.1.20", l5x_project.connection(10, 4))
    code, finding = judge(own, other)
    assert (code, finding["ok"]) == (1, False)
    assert finding["detail"].startswith("connection: the project has 100/101, 4/10 octets or 100/101, the file ")
    sheet = load_eds(eds).connection()
    configuration, outputs, inputs = sheet.points
    points = {"InputCxnPoint": inputs, "OutputCxnPoint": outputs}
    same = l5x_project.connection(sheet.inputs.size.default, sheet.outputs.size.default, element="SINT", **points)
    code, finding = judge(own, l5x_project.module("scale", "192.168.1.20", same))
    assert (code, finding["ok"]) == (0, True), finding
    # the same with keying: the identity of the generic module is none of the device's
    keyed = l5x_project.module("scale", "192.168.1.20", same).replace('State="Disabled"', 'State="ExactMatch"')
    code, finding = judge(own, keyed)
    assert (code, "vendor: the project has 1" in finding["detail"]) == (1, True)
    # by its own file
    assembly = f"[4,{configuration},[0,0,0,0]]"
    numbered = l5x_project.module(
        "scale", "192.168.1.20", same, configuration=assembly, CatalogNumber="X", Major=key.major_revision, **numbers
    )
    (tmp_path / eds.name).write_bytes(eds.read_bytes())
    code, finding = judge(own, numbered.replace('State="Disabled"', 'State="ExactMatch"'))
    assert (code, finding["ok"]) == (0, True), finding


def test_on_profibus_the_identifiers_of_the_modules_count(tmp_path, pnfarm, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    shutil.copy(CONFIGS / "gsd" / "EXMP1D01.gsd", tmp_path)
    plugged = module(1, "GSD:EXMP1D01.GSD/M/1", name="16DI")
    (tmp_path / "line.aml").write_text(project(plc(), slave("valves", "5", "EXMP1D01.GSD", plugged)))

    def judge(slots):
        text = f"devices:\n  - {{name: island, gsd: EXMP1D01.gsd, address: 5, slots: {slots}}}\n"
        done = pnfarm("doctor", farm(tmp_path, text), "--project", tmp_path / "line.aml", "--format", "json")
        findings = {one["name"]: one for one in json.loads(done.out)["findings"]}
        return done.code, findings["valves"]

    code, finding = judge("{1: 16DI}")
    assert (code, finding["ok"]) == (0, True), finding
    code, finding = judge("{1: 8DO}")
    assert (code, finding["ok"], "configuration: the project has" in finding["detail"]) == (1, False, True)


def test_lines_and_a_verdict_are_printed(tmp_path, pnfarm, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    shutil.copy(CONFIGS / ISLAND_FILE, tmp_path / ISLAND)
    (tmp_path / "line.aml").write_text(project(plc(), island(), links=[at_system("island-if")]))
    file = farm(tmp_path, device("other"))
    done = pnfarm("doctor", file, "--project", tmp_path / "line.aml")
    assert done.code == 1
    assert f"1 thing in {file} will keep a PLC from being green." in done.out
    assert "island (line 5)" in done.out
    assert any(line.split()[:2] == ["RED", "island"] for line in done.out.splitlines())


def test_a_project_that_is_none_is_refused(tmp_path, pnfarm, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    file = farm(tmp_path, AXES)
    assert pnfarm("doctor", file, "--project", file).code == 2
    assert pnfarm("doctor", file, "--project", tmp_path / "none.aml").code == 2
    assert pnfarm("doctor", "--project", file).code == 2
