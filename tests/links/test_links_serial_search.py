"""The rate of a port is found by trying: garbage leads to the next one, a telegram and silence to none."""

import asyncio

import pytest

from pnfarm.buses.registry import bus
from pnfarm.config.links import SerialLink as SerialSection
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.farm.lines import make_line
from pnfarm.links.base import PortSpec
from pnfarm.links.serial import link as serial_link
from pnfarm.links.serial.line import LineCounters
from pnfarm.links.serial.link import SerialLink
from pnfarm.protocols.profibus.wire.telegram import Request, Telegram, emit_telegram

POLL = emit_telegram(Telegram(5, 1, 0x40 | Request.FDL_STATUS))


class Port:
    """A port on a line of ``rate``: at any other rate its octets are garbage."""

    kind, where, is_up, has_rate = "port", "/dev/ttyUSB0", True, True

    def __init__(self, rate, baud):
        self.rate, self.baud = rate, baud
        self.counters = LineCounters()
        self.tried = [baud]

    async def open(self):
        pass

    async def close(self):
        pass

    def send(self, octets):
        pass

    def set_receiver(self, receiver):
        self.receiver = receiver

    def set_at_once(self, at_once):
        pass

    def set_baud(self, baud):
        self.baud = baud
        self.tried.append(baud)

    def hears(self, octets):
        self.counters.received += len(octets)
        self.receiver(octets if self.baud == self.rate else bytes(octet ^ 0x5A for octet in octets), 1)


@pytest.fixture(autouse=True)
def _fast(monkeypatch):
    monkeypatch.setattr(serial_link, "SEARCH_SECONDS", 0.005)


async def line_of(rate):
    line = Port(rate, 1_500_000)
    rates = (1_500_000, *(one for one in bus("profibus").baud_rates if one != 1_500_000))
    link = SerialLink(line, bus("profibus").splitter(9_600), 1_500_000, rates)
    heard = []
    link.set_receiver(lambda index, telegram, now: heard.append(telegram))
    (port,) = await link.open([PortSpec("axis-01", b"", line="profibus")])
    return line, link, port, heard


@pytest.mark.parametrize("rate", [1_500_000, 19_200, 12_000_000])
@pytest.mark.asyncio
async def test_the_masters_rate_is_found_and_told(rate):
    line, link, port, heard = await line_of(rate)
    async with asyncio.timeout(5):
        while not heard:
            line.hears(POLL)
            await asyncio.sleep(0.002)
    assert port.rate() == link.baud == line.baud == rate
    tried = list(line.tried)
    for _ in range(10):
        line.hears(POLL)
        await asyncio.sleep(0.002)
    assert line.tried == tried, "telegrams keep it"
    await asyncio.sleep(0.02)
    assert line.tried == tried, "and so does silence"
    await link.close()


@pytest.mark.asyncio
async def test_another_rate_of_the_master_is_found_again():
    line, link, _, heard = await line_of(1_500_000)
    line.hears(POLL)
    assert heard
    line.rate = 500_000
    heard.clear()
    async with asyncio.timeout(5):
        while not heard:
            line.hears(POLL)
            await asyncio.sleep(0.002)
    assert link.baud == 500_000
    await link.close()


def test_a_port_in_the_farm_file_may_ask_for_it_and_nothing_else():
    section = SerialSection.model_validate({"kind": "serial", "port": "/dev/ttyUSB0", "baud": "auto"})
    assert make_line(section, bus("profibus")).baud == 1_500_000
    link, drive = "{kind: serial, pty: auto, baud: auto}", "{name: a, model: moog-msd-dp, address: 5}"
    text = f"farm: dp\nlink: {link}\ndrives:\n  - {drive}\n"
    with pytest.raises(FarmFileError, match="no port whose rate can be tried"):
        parse_farm(text)
