"""`pnfarm param --line`: parameters of any station on a line, by a master of class 2."""

import asyncio
import struct

import pytest

from pnfarm.buses.bus import port_spec
from pnfarm.buses.line_parameters import LineQuestion
from pnfarm.buses.profibus.bus import PROFIBUS
from pnfarm.buses.profibus.controller.line_question import LineParameter, shown_value
from pnfarm.cli.main import main
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.engine.columns import allocate
from pnfarm.errors import ConfigError, RemoteError
from pnfarm.farm.file.reading import parse_farm

FARM = """
farm: dp
link: {kind: memory}
drives:
  - {name: 'msd-{n:02}', count: 2, model: moog-msd-dp, address: 11, realism: {parameter_latency: 20ms}}
"""
MASTER = "controller: {address: 1, cycle: 5ms, program: {kind: constant, speed_rpm: 300}}\n"
DP = model("moog-msd-dp")


class Asker(LineParameter):
    """A node of a virtual world."""

    def __init__(self, *given):
        super().__init__(*given)
        self.columns = allocate(images=1, programs=1, channels=8)


def ask(parameter, value=None, *, station=11, text=FARM, named=None, own=0, before=lambda line: None):
    """The answer, the drive's station, and whatever was asked of it in a world of its own."""

    async def work():
        line = await VirtualLine.create(parse_farm(text))
        try:
            line.world.run(0.5)
            before(line)
            link = line.world.link()
            ports = await link.open([port_spec(PROFIBUS, "param", b"")])
            asker = Asker(link, *ports, LineQuestion(station, parameter, value, own, named))
            line.world.join(asker, ports)
            asker.start(line.world.now)
            assert line.world.run(30.0, until=lambda: asker.done)
            line.world.run(0.5)
            return asker, line
        finally:
            await line.close()

    asker, line = asyncio.run(work())
    return asker, line.farm.axis("msd-01"), line


def test_a_parameter_is_read_by_its_number_and_the_connection_is_given_back():
    asker, station, _ = ask("922")
    found = asker.result()
    assert (found["drive"], found["pnu"], found["value"]) == ("station 11", 922, station.store.get("P-0922"))
    assert station.device.slave.class_two.open == []


@pytest.mark.parametrize(("parameter", "named"), [("1256", None), ("0x4E8", None), ("P-1256", "moog-msd-dp")])
def test_a_parameter_is_written_and_read_back_in_the_format_that_the_drive_has(parameter, named):
    asker, station, _ = ask(parameter, 2, named=named)
    assert asker.result()["value"] == 2
    assert station.store.get("P-1256") == 2
    assert asker.result()["name"] == (DP.parameters[1256].name if named else "")


def test_one_element_of_an_array_is_written_and_the_other_is_not():
    asker, station, _ = ask("924.1", 3)
    assert asker.result()["value"] == 3
    first = DP.parameters[924].defaults[0] if DP.parameters[924].defaults else DP.parameters[924].default
    assert station.store.read(924, 0, 2) == [first, 3]


def test_negative_values_come_back_by_the_models_type():
    name = next(one.name for one in DP.parameters.values() if one.pnu == 1270)
    asker, _, _ = ask(name, -5, named="moog-msd-dp")
    assert asker.result()["value"] == -5


@pytest.mark.parametrize(
    ("parameter", "value", "named", "number"),
    [("9", None, None, 0x00), ("P-0964", 3, "moog-msd-dp", 0x01), ("918", 300, "moog-msd-dp", 0x02),
     ("918.4", 3, None, 0x04)],
)  # fmt: skip
def test_what_the_drive_refuses_has_its_error_number(parameter, value, named, number):
    asker, station, _ = ask(parameter, value, named=named)
    with pytest.raises(ParameterError, match="station 11, parameter"):
        asker.result()
    assert asker.question.refused == number
    assert station.device.slave.class_two.open == []


@pytest.mark.parametrize("named", [None, "moog-msd-dp"])
def test_a_value_that_does_not_fit_is_not_written(named):
    asker, station, _ = ask("1256", 70_000, named=named)
    with pytest.raises(RemoteError, match="70000 does not fit in the 2 octets of the parameter"):
        asker.result()
    assert station.store.get("P-1256") == 0


def test_a_station_that_is_not_there_is_told():
    asker, _, _ = ask("918", station=99)
    with pytest.raises(RemoteError, match=r"station 99, parameter 918\.0: station 99 does not answer"):
        asker.result()


def test_a_line_with_a_master_at_work_is_left_alone():
    asker, station, line = ask("918", text=FARM + MASTER)
    with pytest.raises(RemoteError, match="master 1 is active on this line"):
        asker.result()
    assert asker.master.counts["requests"] == 0
    assert line.controllers.all_connected
    assert station.device.lost.total() == 0


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [({"station": 200}, ConfigError, "200 is not a station address"),
     ({"own": 11}, ConfigError, "cannot have the station's own address"),
     ({"own": 127}, ConfigError, "127 is not an own address"),
     ({"parameter": "P-0918"}, ConfigError, "a name needs the drive's --model"),
     ({"parameter": "918.x"}, ConfigError, "is not the number of a parameter"),
     ({"parameter": "0"}, ParameterError, "impermissible parameter number"),
     ({"named": "moog-msd"}, ConfigError, "no model of this bus"),
     ({"parameter": "P-9999", "named": "moog-msd-dp"}, ParameterError, "has no parameter")],
)  # fmt: skip
def test_what_cannot_be_asked_is_told_before_anything_is_sent(given, error, said):
    with pytest.raises(error, match=said):
        ask(**{"parameter": "918"} | given)


@pytest.mark.parametrize(
    ("value", "code", "shown"),
    [(0xFFFF, 0x42, 0xFFFF), (0xFFFF, 0x03, -1), (0x80, 0x02, -128), (0xFFFFFFFF, 0x04, -1), (7, 0x04, 7),
     (int.from_bytes(struct.pack(">f", 2.5), "big"), 0x08, 2.5), (None, 0x42, None)],
)  # fmt: skip
def test_a_value_without_a_model_is_shown_by_its_format(value, code, shown):
    assert shown_value(value, code, None) == shown


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [(("get", "axis-01", "918", "--line", "/tmp/none"), 2, "'axis-01' is not a station address"),
     (("get", "11", "918", "--line", "/nowhere/line"), 4, "serial port /nowhere/line does not exist"),
     (("get", "11", "918", "--line", "/tmp/none", "--baud", "1234"), 2, "--baud 1234 is none of the line's rates"),
     (("set", "11", "918", "x", "--line", "/tmp/none"), 2, "is not a parameter value"),
     (("get", "11", "918", "--line", "host:0"), 2, "is not like HOST:PORT"),
     (("get", "11", "918", "--line", "rfc2217://host"), 2, "is not like HOST:PORT")],
)  # fmt: skip
def test_the_command_refuses_in_one_sentence(capsys, arguments, code, said):
    assert main(["param", *arguments]) == code
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
