"""Telegrams of a line in a capture, told in the field's words by `pnfarm decode`."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import record, write_frames

from pnfarm.buses import registry
from pnfarm.captures.reading import CapturedFrame
from pnfarm.cli.main import main
from pnfarm.protocols.profibus.wire.dpv1 import Access, Function, Initiate
from pnfarm.protocols.profibus.wire.telegram import Request, Sap, ShortAck, Telegram, Token, emit_telegram

FARM = """
farm: dp
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n:02}}', count: 2, model: moog-msd-dp, address: 11}}
controller:
  name: plc
  address: 3
  cycle: 5ms
  watchdog: 50ms
  {keys}
  program: {{kind: constant, speed_rpm: 100, acknowledge_after: 500ms}}
"""
PROFIBUS_DL = 257
MS = 1_000_000


def recorded(tmp_path, work, keys="access: class-1"):
    """Path of a farm file, and of the capture of ``work``, which is given the line in virtual time."""
    file, capture = tmp_path / "dp.pnfarm.yml", tmp_path / "dp.pcapng"
    file.write_text(FARM.format(keys=keys), "utf-8")
    record(file.read_text("utf-8"), capture, work)
    return file, capture


def decoded(capsys, *arguments):
    """What `decode` prints, line by line without the time."""
    assert main(["decode", *map(str, arguments)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    return [text.partition(" ")[2] for text in said.out.splitlines()]


def written(tmp_path, *telegrams, step_ns=MS):
    """A capture of these octets, in turn."""
    octets = [one if isinstance(one, bytes) else emit_telegram(one) for one in telegrams]
    timed = [(each, 10**18 + place * step_ns) for place, each in enumerate(octets)]
    return write_frames(tmp_path / "line.pcapng", timed, "", PROFIBUS_DL)


def test_the_way_to_data_exchange_and_into_operation_is_told(tmp_path, capsys):
    file, capture = recorded(tmp_path, lambda line: line.world.run(0.1))
    told = [text for text in decoded(capsys, capture, "--farm", file) if "axis-01" in text or "-> all" in text]
    said = [text.replace("plc -> axis-01 ", "> ").replace("axis-01 -> plc ", "< ") for text in told]
    begin = [text for text in said if text.startswith(("> S", "< S", "> C", "< C"))][:8]
    assert begin == [
        "> Slave_Diag.req",
        "< Slave_Diag.res station not ready, prm req; no master; ident 0x0A8E",
        "> Set_Prm.req lock req; watchdog 50 ms; min T_SDR 11 bits; ident 0x0A8E; user 80 00 00 (dpv1 enable)",
        "< Set_Prm.res acknowledged",
        "> Chk_Cfg.req telegram 1, 4 octets of outputs, 4 of inputs (c3 c1 c1 fd 00 01)",
        "< Chk_Cfg.res acknowledged",
        "> Slave_Diag.req",
        "< Slave_Diag.res wd on; master 3; ident 0x0A8E",
    ]
    assert "> cyclic data begin telegram 1, 4 octets; STW1 0x0476 NSOLL_A 0" in said
    assert "> STW1 0x0477 -> 0x047F: enable operation set" in said
    assert any(text.startswith("< ZSW1") and text.endswith("S3 -> S4 operation") for text in said)
    # each drive hears it, and it is told once
    assert said.count("plc -> all Global_Control 0 operate; all slaves") == 2


def test_without_a_farm_file_the_ident_number_and_the_identifiers_name_the_words(tmp_path, capsys):
    _, capture = recorded(tmp_path, lambda line: line.world.run(0.1))
    told = decoded(capsys, capture, "--only", "cyclic")
    assert "station 3 -> axis-01 STW1 0x0477 -> 0x047F: enable operation set" in told


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_parameters_over_records_are_told_by_name(tmp_path, capsys, access):
    def work(line):
        line.plc.write_parameter("axis-02", "P-1283", 4321, line.world.now)
        line.world.run(0.2)
        line.plc.write_parameter("axis-02", "P-0968", 1, line.world.now)
        line.world.run(0.2)

    file, capture = recorded(tmp_path, work, f"access: {access}")
    told = decoded(capsys, capture, "--farm", file, "--only", "dpv1")
    assert all(text.startswith(("plc -> axis-02", "axis-02 -> plc")) for text in told)
    said = " | ".join(text.partition("axis-02")[2] if text.startswith("plc") else text for text in told)
    assert "Write.req slot 0 index 47, 16 octets: change parameter PNU 1283" in said
    assert "Read.res slot 0 index 47, 4 octets: parameter PNU 1283" in said
    assert "error 0x01 (value cannot be changed)" in said.replace("parameter value", "value")
    opened = ["Resource_Manager.res access point 0" in said, "Initiate.req send time-out" in said]
    assert opened == [access == "class-2"] * 2


def test_the_summary_counts_and_has_the_cycle(tmp_path, capsys):
    file, capture = recorded(tmp_path, lambda line: line.world.run(1.0))
    assert main(["decode", str(capture), "--farm", str(file), "--summary", "--format", "json"]) == 0
    talks = json.loads(capsys.readouterr().out)["conversations"]
    assert [talk["between"] for talk in talks][:2] == [["axis-01", "plc"], ["axis-02", "plc"]]
    talk = talks[0]
    assert talk["counts"] == {"connects": 1}
    assert {one["from"] for one in talk["cyclic"]} == {"plc", "axis-01"}
    for one in talk["cyclic"]:
        assert (one["telegram"], one["frame_id"]) == (1, "4 octets")
        assert one["cycle_seconds"] == pytest.approx(0.005, rel=0.05)


def poll(fcb=True, data=b"\x04\x7f\x00\x00", address=5):
    return Telegram(address, 1, 0x50 | 0x20 * fcb | Request.SRD_HIGH, data=data)


def test_the_data_of_a_slave_without_inputs_or_outputs_begin_once(tmp_path, capsys):
    telegrams = []
    for number in range(6):
        fcb = bool(number % 2)
        telegrams += [poll(fcb, b"\x01"), ShortAck()]
        telegrams += [poll(fcb, b"", 6), Telegram(1, 6, 0x08, data=b"\x02")]
    told = decoded(capsys, written(tmp_path, *telegrams))
    begin = "cyclic data begin"
    assert [text for text in told if begin in text] == [
        f"station 1 -> station 5 {begin} 1 octets; 01", f"station 5 -> station 1 {begin} 0 octets;",
        f"station 1 -> station 6 {begin} 0 octets;", f"station 6 -> station 1 {begin} 1 octets; 02",
    ]  # fmt: skip


def test_what_goes_wrong_on_a_line_is_told(tmp_path, capsys):
    broken = bytearray(emit_telegram(poll()))
    broken[6] ^= 1
    capture = written(
        tmp_path,
        poll(), Telegram(1, 5, 0x08, data=b"\x37\x00\x00\x00"),
        poll(fcb=False), poll(fcb=False), Telegram(1, 5, 0x0A, data=b"\x37\x00\x00\x00"),
        Telegram(5, 1, 0x7D, Sap.SLAVE_DIAGNOSIS, Sap.MASTER),
        Telegram(1, 5, 0x08, Sap.MASTER, Sap.SLAVE_DIAGNOSIS, bytes.fromhex("08 0c 00 01 0a 8e 06 81 00 00 01 02")),
        poll(), Telegram(1, 5, 0x03),
        bytes(broken), b"\x99\x98", ShortAck(), Telegram(1, 6, 0x08, data=b"1"), Token(2, 1),
        Telegram(127, 1, 0x46, Sap.GLOBAL_CONTROL, Sap.MASTER, b"\x2a\x03"),
    )  # fmt: skip
    told = decoded(capsys, capture)
    for text in (
        "station 1 -> station 5 no answer of 5 to Data_Exchange.req, 1 ms",
        "station 1 -> station 5 repeated Data_Exchange.req, with the same FCB",
        "station 5 -> station 1 asks for a diagnosis answer of high priority",
        "station 5 -> station 1 Slave_Diag.res ext diag, wd on; master 1; ident 0x0A8E; device 06 81 00 00 01 02",
        "station 5 -> station 1 Data_Exchange.res RS: no service activated",
        "station 1 -> station 2 token of the right to send, 1 to 2",
        "station 1 -> all Global_Control 42 clear data, freeze, sync; groups 0x03",
        "station 6 -> station 1 answer of 6 without a request",
    ):
        assert text in told
    right, wrong = sum(broken[4:-2]) & 0xFF, broken[-2]
    assert [text.partition(":")[0] for text in told if "no telegram" in text] == [
        f"? -> ? no telegram 0x{wrong:02x} instead of 0x{right:02x}",
        "? -> ? no telegram 0x99 begins no telegram",
    ]


def test_a_missing_answer_is_of_the_slave_that_did_not_answer_and_each_counts(tmp_path, capsys):
    """The next telegram, which shows it, is for another slave."""
    telegrams = []
    for number in range(60):
        fcb = bool(number % 2)
        telegrams += [poll(fcb, address=5), poll(fcb, address=6), Telegram(1, 6, 0x08, data=b"\x37\x00\x00\x00")]
    capture = written(tmp_path, *telegrams)
    told = [text for text in decoded(capsys, capture) if "no answer" in text]
    assert {text.partition(" no answer")[0] for text in told} == {"station 1 -> station 5"}
    assert len(told) == 50
    assert decoded(capsys, capture, "--drive", "station 5")[1:] == told
    assert main(["decode", str(capture), "--summary", "--format", "json"]) == 0
    counts = {tuple(talk["between"]): talk["counts"] for talk in json.loads(capsys.readouterr().out)["conversations"]}
    assert counts == {("station 1", "station 5"): {"unanswered": 60}, ("station 1", "station 6"): {}}
    told = decoded(capsys, capture, "--summary")
    assert any(text.endswith("60 without an answer") for text in told)
    assert any(text.endswith("unanswered: 60 x Data_Exchange") for text in told)


def parametrised(ident, identifiers="c3 c1 c1 fd 00 01"):
    """Set_Prm and Chk_Cfg of the slave 5; the identifiers are those of the MSD's telegram 1."""
    prm = bytes.fromhex("88 01 05 0b") + ident.to_bytes(2, "big") + bytes(1)
    return [
        Telegram(5, 1, 0x6D, Sap.SET_PARAMETERS, Sap.MASTER, prm), ShortAck(),
        Telegram(5, 1, 0x5D, Sap.CHECK_CONFIGURATION, Sap.MASTER, bytes.fromhex(identifiers)), ShortAck(),
    ]  # fmt: skip


def polled(times):
    found = []
    for number in range(times):
        found += [poll(bool(number % 2)), Telegram(1, 5, 0x08, data=b"\x02\x37\x00\x00")]
    return found


def test_another_device_at_the_same_address_has_no_names_of_the_first_ones_model(tmp_path, capsys):
    capture = written(tmp_path, *parametrised(0x0A8E), *polled(3), *parametrised(0x1234), *polled(3))
    begun = [text for text in decoded(capsys, capture) if "cyclic data begin" in text]
    assert begun[0] == "station 1 -> station 5 cyclic data begin telegram 1, 4 octets; STW1 0x047F NSOLL_A 0"
    assert begun[2] == "station 1 -> station 5 cyclic data begin 4 octets; 04 7f 00 00"


def test_the_time_without_a_connection_is_no_time_between_two_polls(tmp_path, capsys):
    silence = [Token(1, 1)] * 500
    capture = written(tmp_path, *parametrised(0x0A8E), *polled(20), *silence, *parametrised(0x0A8E), *polled(20))
    assert main(["decode", str(capture), "--summary", "--format", "json"]) == 0
    talks = json.loads(capsys.readouterr().out)["conversations"]
    (talk,) = [talk for talk in talks if talk["cyclic"]]
    for figures in talk["cyclic"]:
        assert figures["frames"] == 40
        assert figures["cycle_seconds"] == figures["interval_max_seconds"] == pytest.approx(0.002)


def test_octets_without_a_station_are_of_no_station(tmp_path, capsys):
    capture = written(tmp_path, poll(), ShortAck(), b"\x99\x98", poll(fcb=False))
    assert main(["decode", str(capture), "--drive", "axis-09"]) == 2
    assert capsys.readouterr().err.endswith("; it has frames of station 1\n")


def test_set_slave_add_initiate_and_refusals_are_told(tmp_path, capsys):
    srd = 0x6D
    capture = written(
        tmp_path,
        Telegram(126, 1, srd, Sap.SET_SLAVE_ADDRESS, Sap.MASTER, bytes.fromhex("15 0a 8e ff")), ShortAck(),
        Telegram(21, 9, srd, Sap.RESOURCE_MANAGER, Sap.MASTER_2, Initiate(500_000_000).emit()),
        Telegram(9, 21, 0x08, Sap.MASTER_2, Sap.RESOURCE_MANAGER, bytes.fromhex("56 02 00 32")),
        Telegram(21, 9, srd, 2, Sap.MASTER_2, Access(Function.READ, 0, 48, 10).emit()), ShortAck(),
        Telegram(21, 9, 0x5D, 2, Sap.MASTER_2),
        Telegram(9, 21, 0x08, Sap.MASTER_2, 2, bytes.fromhex("de 80 b0 00")),
        Telegram(21, 9, srd, 2, Sap.MASTER_2, bytes.fromhex("58 00 20")), ShortAck(),
    )  # fmt: skip
    told = decoded(capsys, capture)
    for text in (
        "station 1 -> station 126 Set_Slave_Add.req address 21, locked; ident 0x0A8E",
        "station 9 -> station 21 Initiate.req send time-out 500 ms",
        "station 21 -> station 9 Resource_Manager.res access point 2, send time-out 500 ms",
        "station 9 -> station 21 Read.req slot 0 index 48, 10 octets",
        "station 21 -> station 9 Read.res(-) 0xB0 (invalid index), code 2 0x00",
        "station 9 -> station 21 Abort 0x20 (user)",
    ):
        assert text in told


OCTETS = st.one_of(
    st.binary(max_size=60),
    st.builds(
        lambda to, of, function, dsap, ssap, data: emit_telegram(Telegram(to, of, function, dsap, ssap, data)),
        st.sampled_from([1, 5, 127]), st.sampled_from([1, 5]), st.sampled_from([0x6D, 0x5D, 0x46, 0x49, 0x08, 0x0A, 3]),
        st.sampled_from([None, 0, 2, 47, 49, 50, 51, 55, 56, 57, 58, 59, 60, 61, 62]),
        st.sampled_from([None, 0, 50, 51, 62]), st.binary(max_size=40),
    ),
    st.sampled_from([emit_telegram(ShortAck()), emit_telegram(Token(1, 2))]),
)  # fmt: skip


@given(st.lists(OCTETS, max_size=12), st.booleans())
def test_whatever_is_on_a_line_is_told_and_nothing_else_happens(telegrams, every_frame):
    decoder = registry.decoder(every_frame=every_frame)
    for number, octets in enumerate(telegrams):
        for line in decoder.feed(CapturedFrame(number, number * MS, octets, link_type=PROFIBUS_DL)):
            assert line.family in {"cyclic", "dp", "dpv1", "fdl"}
            assert decoder.as_dict(line)
    assert sum(talk["frames"] for talk in decoder.summary()) == len(telegrams)
