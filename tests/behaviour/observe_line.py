"""What readings show on a serial line."""

from __future__ import annotations

from open_points import Plc, observes
from virtual_line import VirtualLine

#: Of eight octets in each direction.
TELEGRAM = 106


@observes("eight-octet-answers", {"variable-length": 17, "fixed-length": 14})
def eight_octet_answers(name: str, behaviour: str) -> object:
    """Octets on the line for each answer with eight octets of inputs, all of which the master takes."""
    line = VirtualLine(model=name, behaviour=behaviour, telegram=TELEGRAM, cycle="2ms")
    line.connect()
    line.run(0.1)
    (tally,) = line.farm_link.tallies().values()
    octets, answers = tally.octets.sent, tally.telegrams[1]
    counted = line.plc.master.counts["answers"]
    line.run(0.1)
    count = tally.telegrams[1] - answers
    assert line.plc.master.counts["answers"] - counted == count > 40
    assert len(line.plc.master.stations[0].inputs) == 8
    return (tally.octets.sent - octets) / count


@observes("address-parameter", {"in-force": 11, "setting": 126})
def address_parameter(name: str, behaviour: str) -> object:
    """P-0918 of a drive as it comes whose coding switches are set to 11, by DP-V1."""
    plc = Plc(name, behaviour, 1)
    assert plc.plc.master.stations[0].plan.address == 11
    return plc.read(918)
