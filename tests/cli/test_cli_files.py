"""Commands that need neither a farm nor a network: validate, schema, models, fault kinds, doctor."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cell_file import CELL
from farm_flags import overridden

from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.farm.doctor.machine import Finding
from pnfarm.farm.file.reading import FarmFileError, load_farm

CONFIGS = Path(__file__).resolve().parents[2] / "configs"

FARM = """\
farm: line-1
link: {kind: macvlan, parent: eth1}
drives:
  - name: axis-{n:02}
    count: 3
    model: akd-profinet
    ip: 10.77.0.11/24
"""


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "a.pnfarm.yml"
        path.write_text(text)
        return path

    return write


# -- validate


def test_validate_sums_a_good_file_up(pnfarm, write):
    path = write(FARM)
    found = pnfarm("validate", path)
    assert found.code == 0
    wanted = "farm line-1, 3 drives (3 akd-profinet), on macvlan eth1, API 127.0.0.1:8702"
    assert found.out == f"{path}: OK, {wanted}\n"


def test_the_address_of_an_api_has_brackets_as_one_writes_it(pnfarm, write):
    path = write(FARM + 'api: "[::1]:8702"\n')
    assert pnfarm("validate", path).out.endswith(", API [::1]:8702\n")


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.pnfarm.yml")), ids=lambda path: path.name)
def test_every_file_that_comes_with_the_project_is_valid(pnfarm, path):
    assert pnfarm("validate", path).code == 0


def test_validate_reports_every_error_with_its_line(pnfarm, write):
    path = write(FARM.replace("count: 3", "count: many").replace("akd-profinet", "akd-profibus"))
    found = pnfarm("validate", path)
    assert found.code == 2
    lines = found.err.splitlines()
    assert lines[0].startswith(f"{path}:5: drives[0].count: is 'many'; allowed: ")
    assert lines[1].startswith(f"{path}:6: drives[0].model: ")
    assert found.out == ""


def test_a_models_other_name_in_capitals_is_refused_with_how_it_is_written(pnfarm, write):
    found = pnfarm("validate", write(FARM.replace("akd-profinet", "AKD")))
    assert "drives[0].model: 'AKD' is not a model of this version, did you mean akd?; " in found.err


def test_validate_knows_the_fault_catalogue(pnfarm, write):
    path = write(FARM + "    impair:\n      - kind: losss\n")
    found = pnfarm("validate", path)
    assert found.code == 2
    assert f"{path}:9: drives[0].impair[0].kind: 'losss' is not a kind of fault, did you mean loss?" in found.err


@pytest.mark.parametrize(
    ("impairment", "told"),
    [
        (
            "{kind: sign-of-life-freeze}",
            "impair[0].kind: axis-01 is on EtherNet/IP: its assemblies have no sign of life",
        ),
        ("{kind: record-error, params: {code: read-error}}", "params.code: is for drives on PROFINET"),
        ("{kind: record-error, params: {status: 8}}", None),
    ],
)
def test_validate_knows_what_a_bus_refuses(pnfarm, write, impairment, told):
    text = FARM.replace("model: akd-profinet", "model: akd-ethernetip")
    path = write(text + f"    impair:\n      - {impairment}\n")
    found = pnfarm("validate", path)
    assert found.code == (0 if told is None else 2)
    if told is not None:
        assert found.err.startswith(f"{path}:9: drives[0].impair[0].")
        assert told in found.err


def test_validate_knows_the_faults_that_the_farm_file_adds(pnfarm, write):
    impair = "impair: [{kind: drive-fault, params: {fault: 4711}}]"
    text = FARM.replace("model: akd-profinet", f"model: profidrive\n    {impair}\n    faults: [OWN]")
    assert pnfarm("validate", write(text.replace("OWN", "{number: 4711, name: jam}"))).code == 0
    found = pnfarm("validate", write(text.replace("OWN", "{number: 4712, name: jam}")))
    assert (found.code, "profidrive has no fault '4711'" in found.err) == (2, True)


@pytest.mark.parametrize(
    ("impairment", "told"),
    [
        ("{kind: drive-fault}", "impair[0].params.fault: is missing"),
        ("{kind: drive-fault, params: {fault: 999}}", "impair[0].params: akd-profinet has no fault '999'; it has 107"),
        ("{kind: drive-warning, params: {warning: 999}}", "impair[0].params: akd-profinet has no fault '999'"),
        ("{kind: drive-fault, params: {fault: F702}}", None),
        ("{kind: loss, params: {frames: some}}", "impair[0].params.frames: is 'some'"),
        ("{kind: loss, for: 2s, direction: out, count: 3}", None),
        ("{kind: f702, on: axis-01, after: 500ms}", None),
        ("{kind: f702, share: 50%, most: 3, seed: 4, ttl: 10s, as: trip}", None),
        ("{kind: loss, probability: 0.5, for: 200ms, rate: 2/min, times: 3}", None),
        ("{kind: loss, for: 200ms, times: 3}", "impair[0].times: means nothing without rate"),
        ("{kind: loss, share: 0%}", "impair[0].share: is '0%'"),
        ("{kind: loss, most: 0}", "impair[0].most: "),
        ("{kind: loss, count: 4294967296}", "impair[0].count: "),
        ("{kind: loss, rate: often}", "impair[0].rate: is 'often'"),
        ("{kind: loss, ttl: 1ms}", "impair[0].ttl: is 1ms"),
        ("{kind: loss, as: 'my trip'}", "impair[0].as: "),
        ("{kind: loss, on: spare-*}", "impair[0].on: means no drive of this group"),
        ("{kind: f702, when: velocity > 1000}", None),
        ("{kind: f702, when: velocityy > 1000}", "impair[0].when: column 1: "),
        ("{kind: f702, when: zsw1.operation_enabledd}", "impair[0].when: column 1: "),
    ],
)
def test_validate_checks_what_a_kind_takes(pnfarm, write, impairment, told):
    path = write(FARM + f"    impair:\n      - {impairment}\n")
    found = pnfarm("validate", path)
    assert found.code == (0 if told is None else 2)
    if told is not None:
        assert found.err.startswith(f"{path}:9: drives[0].")
        assert told in found.err


@pytest.mark.parametrize(
    ("when", "told"),
    [
        ("part_present and island-1.pressure > 2 bar", ""),
        ("island-1.valv", "devices[0].impair[0].when: column 1: island-1 has no signal 'valv', did you mean valve?"),
        ("velocity > 3", "devices[0].impair[0].when: column 1: island-1 has no signal 'velocity'"),
    ],
)
def test_validate_checks_what_a_fault_on_a_device_waits_for(pnfarm, write, when, told):
    path = write(CELL + f"    impair:\n      - {{kind: silence, when: {when}}}\n")
    found = pnfarm("validate", path)
    assert told in found.err
    assert found.code == (2 if told else 0)


def test_validate_refuses_two_impairments_of_one_name(pnfarm, write):
    path = write(FARM + "    impair:\n      - {kind: loss, as: trip}\n      - {kind: f702, as: trip}\n")
    found = pnfarm("validate", path)
    assert found.code == 2
    assert "impair[1].as: 'trip' is the name of another fault" in found.err


@pytest.mark.parametrize(
    ("controller", "told"),
    [
        ("{ip: 10.77.0.1/24}", None),
        ("{ip: 10.77.0.1/24, interface: eth1}", "controller.interface: is not reached from drives in memory"),
        ("{ip: 10.77.0.1/24, mac: 02:00:00:00:00:01, interface: eth1}", "controller.interface: is not reached"),
        ("{ip: 10.77.0.1/24, link: {kind: veth}}", "controller.link: is not reached from drives in memory"),
    ],
)
def test_validate_refuses_a_controller_that_drives_in_memory_cannot_have(pnfarm, write, controller, told):
    path = write(FARM.replace("{kind: macvlan, parent: eth1}", "{kind: memory}") + f"controller: {controller}\n")
    found = pnfarm("validate", path)
    assert found.code == (0 if told is None else 2), found.err
    if told is not None:
        assert told in found.err


def test_a_program_whose_file_is_missing_is_reported_with_its_line(pnfarm, write):
    path = write(FARM + "controller:\n  ip: 10.77.0.1/24\n  program: {python: plcs.py}\n")
    found = pnfarm("validate", path)
    (line,) = found.err.splitlines()
    assert (found.code, line.startswith(f"{path}:{len(FARM.splitlines()) + 3}: controller.program.python: ")) == (
        2,
        True,
    )
    assert "plcs.py cannot be read: no such file" in line


def test_a_missing_file_is_bad_input(pnfarm, tmp_path):
    found = pnfarm("validate", tmp_path / "none.yml")
    assert found.code == 2
    assert "cannot be read: no such file or directory" in found.err


@pytest.mark.parametrize("line", [("up",), ("down",), ("plc",)])
def test_every_command_checks_its_file_first(pnfarm, write, line):
    found = pnfarm(*line, write("farm: x\n"))
    assert found.code == 2
    assert "drives: is missing" in found.err


# -- settings from outside


def test_a_setting_from_outside_wins_over_the_file():
    config = overridden(FARM, {"api": "127.0.0.1:9000", "parent": "eth7", "cpu": 1, "fifo": 50, "mlockall": True})
    assert config.api.listen == ("127.0.0.1", 9000)
    assert config.link.parent == "eth7"
    assert (config.realtime.cpu, config.realtime.fifo, config.realtime.mlockall) == (1, 50, True)


def test_the_api_can_be_switched_off_from_outside():
    assert overridden(FARM, {"api": "off"}).api is None


def test_another_address_keeps_the_files_token_and_another_token_the_files_address():
    text = FARM + "api: {listen: '127.0.0.1:8702', token: 'secret-of-the-file'}\n"
    config = overridden(text, {"api": "0.0.0.0:9000"})
    assert (config.api.listen, config.api.token) == (("0.0.0.0", 9000), "secret-of-the-file")
    config = overridden(text, {"token": "another-secret"})
    assert (config.api.listen, config.api.token) == (("127.0.0.1", 8702), "another-secret")


def test_another_address_or_token_keeps_the_tokens_file():
    text = FARM + "api: {listen: '127.0.0.1:8702', token_file: key}\n"
    config = overridden(text, {"api": "0.0.0.0:9000"})
    assert (config.api.listen, config.api.token_file) == (("0.0.0.0", 9000), "key")
    config = overridden(text, {"token": "another-secret"})
    assert (config.api.token, config.api.token_file) == ("another-secret", "key")


def test_a_state_of_the_command_line_is_where_the_user_is_and_one_of_the_file_beside_it(write, monkeypatch, tmp_path):
    file = write(FARM + "state: memory\n")
    here = tmp_path / "elsewhere"
    here.mkdir()
    monkeypatch.chdir(here)
    text = file.read_text("utf-8")
    assert overridden(text, {"state": "memory"}).state_directory == here / "memory"
    assert load_farm(file).state_directory == file.parent / "memory"
    database = "postgresql://user@db/farm"
    assert overridden(text, {"state": database}).state_database == database
    with pytest.raises(ConfigError, match="--state: state: is a URL of 'mysql'; allowed: a folder, or a database"):
        overridden(text, {"state": "mysql://user@db/farm"})


@pytest.mark.parametrize(
    ("sources", "origin"), [({}, "--parent"), ({"parent": "ENVIRONMENT"}, "PNFARM_UP_LINK_PARENT")]
)
def test_a_wrong_setting_is_reported_with_where_it_comes_from(sources, origin):
    with pytest.raises(FarmFileError) as caught:
        overridden(FARM, {"parent": "a name with blanks"}, **sources)
    assert str(caught.value).startswith(f"{origin}: link.parent: ")


def test_the_environment_reaches_the_farm(pnfarm, write, monkeypatch):
    monkeypatch.setenv("PNFARM_UP_LINK_PARENT", "no such name")
    found = pnfarm("up", write(FARM))
    assert found.code == 2
    assert found.err.startswith("PNFARM_UP_LINK_PARENT: link.parent: ")


def test_a_flag_wins_over_the_environment(pnfarm, write, monkeypatch):
    monkeypatch.setenv("PNFARM_UP_LINK_PARENT", "no such name")
    found = pnfarm("up", write(FARM), "--parent", "no name either")
    assert found.code == 2
    assert found.err.startswith("--parent: link.parent: ")


# -- schema, models, kinds


def test_schema_is_json_and_names_the_fault_kinds(pnfarm):
    found = json.loads(pnfarm("schema", "farm").out)
    assert found["$schema"].endswith("/schema")
    assert "f702" in found["$defs"]["Impairment"]["properties"]["kind"]["enum"]


def test_models_lists_and_describes(pnfarm):
    assert "akd-profinet" in pnfarm("models").out
    listed = json.loads(pnfarm("models", "--format", "json").out)
    assert {"name", "maker", "bus", "aliases"} <= set(listed[0])


def test_a_model_is_printed_with_the_source_of_its_values(pnfarm):
    found = pnfarm("models", "akd-profinet")
    assert found.code == 0
    lines = found.out.splitlines()
    (vendor,) = [line for line in lines if line.startswith("vendor id")]
    assert "0x0105" in vendor
    assert "PI manufacturer table" in vendor
    assert any(line.startswith("1 (default)") and "NSOLL_A" in line and "5.11.2" in line for line in lines)
    assert any("parameters" in line and line.strip()[:3].isdigit() for line in lines)
    (window,) = [line for line in lines if line.startswith("ramp velocity window")]
    assert "1.0 rpm" in window
    assert "assumed" in window


def test_a_model_as_json_has_the_promised_keys(pnfarm):
    found = json.loads(pnfarm("models", "akd", "--format", "json").out)
    assert {"identity", "dap", "telegrams", "parameters", "faults", "limits"} <= set(found)
    assert {"module_ident", "submodules"} <= set(found["dap"])
    submodule = found["telegrams"][0]["submodules"][0]
    assert {"slot", "subslot", "ident", "api", "input_bytes", "output_bytes"} <= set(submodule)


def test_an_unknown_model_says_which_there_are(pnfarm):
    found = pnfarm("models", "adk-profinet")
    assert found.code == 2
    assert "did you mean akd-profinet?" in found.err


def test_fault_kinds_prints_every_kind_with_its_parameters(pnfarm):
    text = pnfarm("fault", "kinds").out
    assert any(line.startswith("timeout ") for line in text.splitlines())
    assert "  fault=" in text
    kinds = {kind["kind"]: kind for kind in json.loads(pnfarm("fault", "kinds", "--format", "json").out)["kinds"]}
    assert kinds["drive-fault"]["params"]["fault"]["required"]


@pytest.mark.parametrize("kind", sorted(fault_kinds()))
def test_one_kind_of_fault_is_shown_as_a_page(pnfarm, kind):
    text = " ".join(pnfarm("fault", "kinds", kind).out.split())
    described = fault_kinds()[kind].as_dict()
    for part in (described["doc"], described["wire"], described["reports"], *described["params"]):
        assert " ".join(part.split())[:60] in text
    assert f"next: pnfarm fault add {kind} --on DRIVE" in text
    assert json.loads(pnfarm("fault", "kinds", kind, "--format", "json").out)["kind"] == kind


def test_an_unknown_kind_says_which_is_meant(pnfarm):
    found = pnfarm("fault", "kinds", "timeot")
    assert (found.code, "did you mean timeout?" in found.err) == (2, True)


# -- doctor

FINE = Finding("python", True, "3.11")
NOTE = Finding("processors", None, "1 usable", "give it a second one")
GONE = Finding("CAP_NET_RAW", False, "missing", "run with sudo")


@pytest.mark.parametrize(("findings", "code"), [([FINE], 0), ([FINE, NOTE], 0), ([FINE, NOTE, GONE], 4)])
def test_doctor_fails_only_for_what_a_farm_cannot_do_without(pnfarm, monkeypatch, findings, code):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", lambda: findings)
    found = pnfarm("doctor")
    assert found.code == code
    for finding in findings:
        assert finding.detail in found.out
        assert finding.remedy in found.out
    as_json = pnfarm("doctor", "--format", "json")
    assert as_json.code == code
    answer = json.loads(as_json.out)
    assert answer["ok"] is (code == 0)
    assert [finding["name"] for finding in answer["findings"]] == [finding.name for finding in findings]


def test_the_controller_of_a_memory_link_runs_with_its_farm_not_beside_it(pnfarm, write):
    text = FARM.replace("{kind: macvlan, parent: eth1}", "{kind: memory}") + "controller: {ip: 10.77.0.1/24}\n"
    found = pnfarm("plc", write(text))
    assert found.code == 2
    assert "runs in the farm's own process: `pnfarm up FILE` starts both" in found.err


def test_the_controller_says_before_it_runs_that_its_summary_cannot_be_written(pnfarm, write, tmp_path):
    found = pnfarm("plc", write(FARM + "controller: {ip: 10.77.0.1/24}\n"), "--json", tmp_path / "no" / "file")
    where = f"{tmp_path}/no/file is in {tmp_path}/no, which is not a folder"
    name = "give the name of a file in a folder that exists"
    assert (found.code, found.out, found.err) == (2, "", f"pnfarm: {where}; {name}\n")


def test_a_run_that_does_not_begin_leaves_no_empty_file_behind(pnfarm, write, tmp_path):
    summary, link = tmp_path / "summary.json", tmp_path / "link.json"
    link.symlink_to(summary)
    for file in (summary, link):
        assert pnfarm("plc", write(FARM), "--json", file).code == 2
        assert not summary.exists()
    assert link.is_symlink()
    summary.write_text("an earlier one")
    assert pnfarm("plc", write(FARM), "--json", summary).code == 2
    assert summary.read_text() == "an earlier one"


def test_frames_in_memory_are_not_captured_by_up(pnfarm, write, tmp_path):
    text = FARM.replace("{kind: macvlan, parent: eth1}", "{kind: memory}")
    found = pnfarm("up", write(text), "--pcap", tmp_path / "out.pcapng")
    assert found.code == 2
    assert "no interface to capture from" in found.err


def test_plc_needs_a_controller_section(pnfarm, write):
    found = pnfarm("plc", write(FARM))
    assert found.code == ConfigError.exit_code
    assert "controller" in found.err
