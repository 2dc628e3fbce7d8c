"""``pnfarm gsdml``: the file that engineering tools import."""

from pathlib import Path

import pytest

from pnfarm.cli.plc_device import one_device
from pnfarm.drives.catalogue import models
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml


@pytest.mark.parametrize("name", sorted(name for name, entry in models().items() if entry.bus == "profinet"))
def test_the_file_is_written_and_its_path_printed(pnfarm, tmp_path, name):
    done = pnfarm("gsdml", name, "-o", tmp_path)
    (path,) = tmp_path.iterdir()
    assert (done.code, done.out, done.err) == (0, f"{path}\n", "")
    assert path.name.startswith("GSDML-V2.35-pnfarm-")
    assert parse_gsdml(path.read_bytes()).daps[0].modules


def test_it_is_written_to_the_current_folder(pnfarm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = pnfarm("gsdml", "akd")
    (path,) = tmp_path.iterdir()
    assert done.out == f"{path.name}\n"


def test_a_dash_prints_it(pnfarm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = pnfarm("gsdml", "akd", "-o", "-")
    assert done.code == 0
    assert parse_gsdml(done.out.encode()).vendor_id == 0x0105
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("folder", ["new", "new/", "new/deeper", "v2.35"])
def test_a_folder_that_is_not_there_is_made(pnfarm, tmp_path, folder):
    done = pnfarm("gsdml", "akd", "-o", f"{tmp_path}/{folder}")
    assert done.code == 0, done.err
    (path,) = (tmp_path / folder).iterdir()
    assert done.out == f"{path}\n"


def test_a_name_of_a_file_is_no_folder_to_make(pnfarm, tmp_path):
    done = pnfarm("gsdml", "akd", "-o", tmp_path / "akd.xml")
    assert (done.code, done.out) == (2, "")
    assert "akd.xml is not a folder; give the folder, the file is called GSDML-V2.35-pnfarm-akd-" in done.err
    assert not list(tmp_path.iterdir())


def test_an_unknown_model_and_a_folder_that_cannot_be_made_are_reported(pnfarm, tmp_path):
    done = pnfarm("gsdml", "akd-profient")
    assert (done.code, done.out) == (2, "")
    assert "there is no drive model 'akd-profient'" in done.err
    assert "did you mean akd-profinet?" in done.err
    (tmp_path / "file").touch()
    for place, code, why in (
        ("file", 2, "file is not a folder"), ("file/below", 4, "cannot be written: not a directory"),
    ):  # fmt: skip
        done = pnfarm("gsdml", "akd", "-o", tmp_path / place)
        assert (done.code, done.out, why in done.err) == (code, "", True)


def test_a_model_in_full_shows_what_only_its_file_says(pnfarm):
    shown = pnfarm("models", "akd").out
    assert "DESCRIPTION FILE" in shown
    assert "max cycle ns" in shown
    assert "alarms" in shown


# plc by a GSDML file alone

ALL = ("--device", "axis-1", "--ip", "10.77.0.11/24", "--interface", "eth9")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "FILE: give a farm file, --project or --gsdml"),
        (("a.yml", "--gsdml", "b.xml"), "FILE: give a farm file, --project or --gsdml"),
        (("a.yml", "--device", "axis-1"), "needs --gsdml"),
        (("--gsdml", "b.xml", *ALL[2:]), "--device: is required with --gsdml"),
        (("--gsdml", "b.xml", *ALL[:2], *ALL[4:]), "--ip: is required with --gsdml"),
        (("--gsdml", "b.xml", *ALL[:4]), "--interface: is required with --gsdml"),
        (("--gsdml", "b.xml", *ALL, "--module", "1"), "'1' is not like 1=MODULE"),
        (("--gsdml", "b.xml", *ALL, "--module", "1=A", "--module", "1=B"), "slot 1 is given twice"),
        (("--gsdml", "b.xml", *ALL, "--module", "x=A"), "'x' is not a slot or subslot"),
        (("--gsdml", "b.xml", *ALL, "--cycle", "3ms"), "3ms is not a PROFINET cycle"),
        (("a.yml", "--watchdog-factor", "5"), "needs --gsdml"),
        (("--gsdml", "b.xml", *ALL, "--watchdog-factor", "0"), "watchdog_factor: is 0; allowed: "),
        (("--gsdml", "b.xml", *ALL, "--watchdog-factor", "500"), "are too long a watchdog; allowed: a watchdog of"),
        (("--gsdml", "b.xml", *ALL, "--device", "Axis_1"), "'Axis_1' is not a station name"),
    ],
)
def test_options_of_a_device_that_do_not_fit_are_bad_input(pnfarm, arguments, sentence):
    done = pnfarm("plc", *arguments)
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err.replace("invalid value for ", "")


def test_options_make_a_farm_file_of_one_device():
    config = one_device(
        Path("b.xml"), device="a", ip="10.0.0.5/24", interface="eth9", dap="D", modules=["1=X", "2="], cycle="32ms"
    )
    (device,) = config.controller.devices
    assert config.controller.watchdog_factor == 3
    patient = one_device(
        Path("b.xml"), device="a", ip="10.0.0.5/24", interface="eth9", dap=None, modules=(), cycle=None,
        watchdog_factor=60,
    )  # fmt: skip
    assert patient.controller.watchdog_factor == 60
    assert (device.name, device.gsdml, str(device.ip), device.dap) == ("a", "b.xml", "10.0.0.5/24", "D")
    assert (device.modules, device.cycle_ns, config.controller.interface) == ({1: "X", 2: None}, 32_000_000, "eth9")
