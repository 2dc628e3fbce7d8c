"""Frames of PROFINET that say something wrong of themselves, or are lost by their class."""

import pytest
from fault_line import FaultLine

from pnfarm.table.channel import DISCARD_INVALID, IOXS_BAD, IOXS_GOOD, STATUS_RUN

CYCLE = 0.016


@pytest.mark.parametrize("kind", ["iops-bad", "provider-stop"])
def test_the_status_of_the_drives_data_says_what_is_wrong_and_is_good_again(line, kind):
    def looks_good():
        row = line.input_row()
        return bool(row.data_status & STATUS_RUN), int(row.iops)

    assert looks_good() == (True, IOXS_GOOD)
    fault = line.add(kind)
    line.run(CYCLE)
    assert looks_good() == ((True, IOXS_BAD) if kind == "iops-bad" else (False, IOXS_GOOD))
    line.run(10 * CYCLE)
    assert fault.evidence().activations == 11
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.run(CYCLE)
    assert looks_good() == (True, IOXS_GOOD)
    assert line.losses() == 0


def test_invalid_data_is_thrown_away_by_the_controller(line):
    line.add("data-invalid", count=2)
    line.run(5 * CYCLE)
    assert line.input_row().discarded[DISCARD_INVALID] == 2
    assert line.losses() == 0


def test_dcp_silence_hides_a_drive_from_a_search():
    line = FaultLine()
    fault = line.add("dcp-silence")
    line.run(3.0)
    assert line.session().state in {"SEARCH", "WAIT"}
    assert fault.evidence().activations >= 2
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.connect()


def test_rpc_silence_lets_a_drive_be_found_and_not_connected(line):
    fault = line.add("rpc-silence")
    line.run(1.0)
    assert line.losses() == 0, "cyclic data goes on"
    line.add("ar-abort")
    line.run(5.0)
    assert line.session().state == "CONNECT"
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.connect(30.0)
