"""Captures: of a line in virtual time, of an originator and a device, of octets."""

import asyncio

from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.capture.pcap import PcapngWriter


def record(farm, file, work=None, *, seconds=0.0, connected=False, epoch_ns=0) -> None:
    """Until all drives are in operation, or all stations ``connected``; then ``work(line)`` and so many seconds more.

    ``farm``: the text of a farm file, or its configuration.
    """

    async def run():
        config = parse_farm(farm) if isinstance(farm, str) else farm
        line = await VirtualLine.create(config, pcap=file, epoch_ns=epoch_ns)
        try:
            plc = line.controllers
            assert line.world.run(10.0, until=lambda: plc.all_connected if connected else plc.all_running)
            if work is not None:
                work(line)
            line.world.run(seconds)
        finally:
            await line.close()

    asyncio.run(run())


def write_frames(file, frames, interface="eth1", link_type=1):
    """Octets with their times; the file."""
    writer = PcapngWriter(file)
    number = writer.add_interface(interface, link_type=link_type)
    for octets, time_ns in frames:
        writer.write(number, octets, time_ns, "in")
    writer.close()
    return file
