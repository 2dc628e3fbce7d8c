"""The farm of an imported project and the project's own controllers, in one virtual world."""

import asyncio
from contextlib import contextmanager
from ipaddress import ip_interface

from pnfarm.cli.projects.plc import project_plc
from pnfarm.controller import line as controller_line
from pnfarm.farm.file.reading import load_farm
from pnfarm.station.event_log import EventLog

#: The controller's where the project names none.
OWN = "192.168.1.250/24"


@contextmanager
def running(file, farm, folders=None, seconds=5, **options):
    """What ``plc --project`` makes of ``file`` runs the devices of the farm file that ``import`` made of it.

    Yields the controllers, what the command found, and the capture with all frames.
    """
    text = farm.read_text()
    for link in ("link: {kind: macvlan, parent: eth1}", "link: {kind: serial, pty: auto}"):
        text = text.replace(link, "link: {kind: memory}")
    farm.write_text(text)
    capture = farm.with_suffix(".pcapng")

    async def start():
        line = await controller_line.VirtualLine.create(load_farm(farm), pcap=capture)
        with project_plc(file, folders or [file.parent], interface="eth1", **options) as found:
            for section in found.config.controllers:
                # in this world there is no interface
                vars(section).update({"interface": None, "ip": getattr(section, "ip", None) or ip_interface(OWN)})
            joined = await controller_line.join_controllers(line.world, found.config, [], EventLog(quiet=True))
        line.world.run(seconds)
        await line.close()
        return joined.controllers, found

    yield (*asyncio.run(start()), capture)
