"""A capture of a farm on EtherNet/IP and its scanner, shown with the farm's file."""

import json

import pytest
from recorded import record

from pnfarm.cli.main import main

FARM = """\
farm: line
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, model: akd-ethernetip, ip: 10.77.0.11/24}
controller:
  name: plc
  ip: 10.77.0.1/24
  rpi: 10ms
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """The capture has no TCP, because streams are joined directly in memory."""
    folder = tmp_path_factory.mktemp("line")
    record(FARM, folder / "line.pcapng", seconds=0.5)
    (folder / "line.pnfarm.yml").write_text(FARM)
    return folder / "line.pcapng"


def test_the_farm_file_lends_layouts_and_models(line, capsys):
    assert main(["decode", str(line), "--farm", str(line.with_name("line.pnfarm.yml")), "--only", "cyclic"]) == 0
    found = capsys.readouterr().out
    for name in ("axis-1", "axis-2"):
        assert f"plc -> {name} control word 0x01 -> 0x80: load start reset, enable set" in found
        assert f"{name} -> plc status word 1" in found
        assert "enable state set" in found
    assert "layout unknown" not in found
    assert "wrong length" not in found


def test_without_it_the_data_are_shown_raw(line, capsys):
    assert main(["decode", str(line), "--only", "cyclic"]) == 0
    assert "layout unknown, no Forward_Open in the capture" in capsys.readouterr().out


def test_the_summary_has_both_directions_at_their_interval(line, capsys):
    options = ["--farm", str(line.with_name("line.pnfarm.yml")), "--summary", "--format", "json"]
    assert main(["decode", str(line), *options]) == 0
    talks = json.loads(capsys.readouterr().out)["conversations"]
    (talk,) = [talk for talk in talks if set(talk["between"]) == {"axis-1", "plc"}]
    assert {channel["from"] for channel in talk["cyclic"]} == {"axis-1", "plc"}
    for channel in talk["cyclic"]:
        assert channel["cycle_seconds"] == 0.01
        assert channel["interval_mean_seconds"] == pytest.approx(0.01, rel=0.05)
        assert channel["frames_missing"] == channel["counter_jumps"] == 0
