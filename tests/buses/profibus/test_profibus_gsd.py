"""The GSD file of the MSD: what its model and its manual say, and nothing else."""

import re
from dataclasses import replace

import pytest

from pnfarm.buses.profibus.description.sheet import describe_model, file_name
from pnfarm.cli.main import main
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.identity import with_identity
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.writer import emit_gsd

DP = model("moog-msd-dp")
MODULE = re.compile(r'Module = "([^"]+)" ((?:0x[0-9A-F]{2},?)+)\r\n(\d+)\r\nEndModule')


def text_of(described=DP):
    return emit_gsd(describe_model(described)).decode("ascii")


def keys(text):
    return dict(re.findall(r"(?m)^([\w.()]+) = (.*?)\r$", text.partition("\nModule")[0]))


def test_6_1_every_telegram_is_a_module_with_its_identifiers_and_its_number():
    modules = {
        int(number): bytes(int(octet, 16) for octet in octets.split(","))
        for _, octets, number in MODULE.findall(text_of())
    }
    assert modules == {number: one.identifiers for number, one in DP.profidrive.telegrams.items()}


def test_6_1_identity_rates_and_lengths_are_the_models():
    found = keys(text_of())
    assert (found["Vendor_Name"], found["Ident_Number"]) == ('"Moog"', "0x0A8E")
    assert (found["Hardware_Release"], found["Software_Release"]) == ('"V1.0"', '"V124.25.0"')
    rates = [key for key, value in found.items() if re.fullmatch(r"[\d.]+M?_supp", key) and value == "1"]
    assert rates == [
        "9.6_supp", "19.2_supp", "45.45_supp", "93.75_supp", "187.5_supp", "500_supp", "1.5M_supp", "3M_supp",
        "6M_supp", "12M_supp",
    ]  # fmt: skip
    assert [int(found[f"MaxTsdr_{rate.removesuffix('_supp')}"]) for rate in rates] == list(
        DP.bus_facts["max_tsdr_bits"].value
    )
    assert found["Auto_Baud_supp"] == "1", "17.2"
    # telegram 120: the parameter channel and 30 words
    assert (found["Max_Input_Len"], found["Max_Output_Len"], found["Max_Data_Len"]) == ("68", "68", "136")
    assert found["Max_Diag_Data_Len"] == "18", "table 9.21"
    assert (found["DPV1_Slave"], found["C1_Max_Data_Len"], found["C2_Max_Data_Len"]) == ("1", "240", "240")
    assert int(found["C2_Max_Count_Channels"]) == DP.bus_facts["connections"].value
    assert found["Min_Slave_Intervall"] == "10", "17.2: 1 ms, in steps of 100 us"


def test_every_line_of_the_file_ends_as_tools_want_it_and_no_key_stands_twice():
    text = text_of()
    assert text.isascii()
    assert text.count("\n") == text.count("\r\n")
    named = re.findall(r"(?m)^([\w.()]+) = ", text.partition("\nModule")[0])
    assert len(named) == len(set(named))


def test_another_ident_number_gives_another_file_of_another_name():
    other = with_identity(DP, {"device": 0x1234})
    assert (file_name(DP), file_name(other)) == ("MOOG0A8E.gsd", "MOOG1234.gsd")
    assert keys(text_of(other))["Ident_Number"] == "0x1234"


@pytest.mark.parametrize(("interval", "steps"), [(1, "1"), (100_000, "1"), (100_001, "2"), (6_000_000, "60")])
def test_the_least_time_between_polls_is_rounded_up(interval, steps):
    described = replace(DP, limits=replace(DP.limits, min_cycle_ns=interval))
    assert keys(text_of(described))["Min_Slave_Intervall"] == steps


def test_a_model_of_another_bus_has_no_gsd_file():
    with pytest.raises(ConfigError, match="moog-msd is on profinet: a GSD file describes a slave of PROFIBUS"):
        describe_model(model("moog-msd"))


def test_the_command_writes_the_file_into_a_folder(tmp_path, capsys):
    assert main(["gsd", "msd-dp", "-o", str(tmp_path / "new")]) == 0
    path = tmp_path / "new" / "MOOG0A8E.gsd"
    assert capsys.readouterr().out.strip() == str(path)
    assert path.read_bytes() == emit_gsd(describe_model(DP))


def test_the_command_refuses_a_name_of_a_file(tmp_path, capsys):
    assert main(["gsd", "moog-msd-dp", "-o", str(tmp_path / "msd.gsd")]) == 2
    assert "the file is called MOOG0A8E.gsd" in capsys.readouterr().err
