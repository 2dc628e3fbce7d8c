"""Names of stations in a project, and on the network: pairs of public captures and exports."""

import pytest

from pnfarm.buses.profinet.project.names import name_on_network


@pytest.mark.parametrize(
    ("name", "searched"),
    [
        ("PLC_1", "plcxb1d0ed"),
        ("IO-Device_1", "io-devicexb15b32"),
        ("plc_1.profinet-schnittstelle_1", "plcxb1.profinet-schnittstellexb15ee1"),
        ("plc_bench.profinet interface_2", "plcxbbench.profinetxainterfacexb25fbd"),
        ("plc.profinet interface_1", "plc.profinetxainterfacexb13a48"),
        ("plc_1.profinet interface_1", "plcxb1.profinetxainterfacexb1036c"),
        ("Axis-01.line", "axis-01.line"),
        ("", ""),
    ],
)
def test_a_station_of_a_project_has_the_name_that_an_s7_searches_for(name, searched):
    assert name_on_network(name) == searched
