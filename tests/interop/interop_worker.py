"""A farm or a controller in a process of its own, told what to do by lines of JSON on its standard input.

``python interop_worker.py farm FILE`` or ``... plc FILE``.  Every line ``{"do": VERB, ...}`` is answered by one
``{"ok": VALUE}`` or ``{"error": TEXT}``; the first line, before any was asked, says that it is up.  The end of the
input ends it in good order.
"""

# ruff: noqa: T201 - what it prints is its answer

import asyncio
import json
import os
import sys
import time
import traceback
from dataclasses import asdict, is_dataclass, replace

from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.controller.runtime import Plc
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.drives.description.identity import with_identity
from pnfarm.errors import PnfarmError
from pnfarm.farm import farm as farm_module
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import load_farm
from pnfarm.farm.views.controller_view import controller_view
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.links.base import unwrap
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.records.diagnosis import Maintenance
from pnfarm.station.event_log import EventLog
from pnfarm.table.signals import WORD_NONE

ANSWER_SECONDS = 10.0


def plain(value):
    """Something that JSON can hold."""
    if isinstance(value, bytes):
        return value.hex()
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def tailored(config):
    """A drive's model; the one named ``captured-drive`` fits the real drive of a capture.

    That has a second port, and a telegram of six words each way.
    """
    model = with_identity(model_by_name(config.model), config.identity)
    if config.name != "captured-drive":
        return model
    port = next(s for s in model.dap.submodules if s.subslot == 0x8001)
    telegram = model.profidrive.telegrams[1]
    access_point, data = telegram.module.submodules
    data = replace(data, input_bytes=12, output_bytes=12)
    telegram = replace(
        telegram,
        output=(*telegram.output, None, None, None, None),
        input=(*telegram.input, None, None, None, None),
        output_words=(*telegram.output_words, *[WORD_NONE] * 4),
        input_words=(*telegram.input_words, *[WORD_NONE] * 4),
        module=replace(telegram.module, submodules=(access_point, data)),
    )
    return replace(
        model,
        dap=replace(model.dap, submodules=(*model.dap.submodules, replace(port, subslot=0x8002))),
        profidrive=replace(model.profidrive, telegrams={**model.profidrive.telegrams, 1: telegram}),
    )


class FarmWorker:
    def __init__(self, path):
        self.farm = Farm(load_farm(path), log=EventLog(quiet=True))

    async def __aenter__(self):
        await self.farm.open()
        return self

    async def __aexit__(self, *_):
        await self.farm.close()

    def wait(self):
        return self.farm.wait()

    def station(self, name):
        return self.farm.core.axis(name)

    def do_drive(self, name):
        """What one drive knows of itself."""
        station = self.station(name)
        axis = station.handle.axis
        return {
            "name": station.device.name,
            "mac": station.port.mac.hex(":"),
            "ip": str(station.device.ip.address or ""),
            "ars": len(station.device.ars),
            "established": any(ar.established for ar in station.device.ars.values()),
            "connects": station.device.connects,
            "aborts": dict(station.device.losses()),
            "watchdog_expirations": station.device.watchdog_expirations,
            "state": int(axis.drive.state),
            "zsw1": int(axis.profidrive.zsw1),
            "stw1": int(axis.profidrive.stw1),
            "velocity_rpm": float(axis.motor.velocity),
            "velocity_step": float(axis.profidrive.settings.velocity_step),
            "fault": int(axis.faults.code[0]) & 0xFFFFFF,
            "signalled": station.station.signalled_ns is not None,
            "signalling": station.device.dcp.signalling,
            "discards": station.device.discards(),
            "neighbours": drive_snapshot(self.farm.core, station, time.monotonic_ns())["neighbours"],
        }

    def do_drives(self):
        return [self.do_drive(station.configured_name) for station in self.farm.core.axes]

    def do_cip(self, name):
        """What a drive on EtherNet/IP knows of itself and its connections."""
        device = self.station(name).device
        columns, (providers, consumers) = self.farm.core.columns, device.channel_rows
        return {
            **device.view(time.monotonic_ns()),
            **device.details(),
            "mac": device.port.mac.hex(":"),
            "connects": device.connects,
            "losses": dict(device.losses()),
            "discards": device.discards(),
            "sent": sum(int(columns.ppm[row].sent) for row in providers),
            "received": sum(int(columns.cpm[row].received) for row in consumers),
            "streams": device.adapter.encapsulation.streams,
        }

    def do_cips(self):
        return {station.configured_name: self.do_cip(station.configured_name) for station in self.farm.core.axes}

    def do_process(self):
        """What the whole farm has: memory in octets, open files, what its link dropped."""
        with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - one read of a kernel file
            pages = int(file.read().split()[1])
        return {
            "rss": pages * os.sysconf("SC_PAGE_SIZE"),
            "files": len(os.listdir("/proc/self/fd")),  # noqa: PTH208 - as above
            "dropped": dict(unwrap(self.farm.link).counters.dropped),
        }

    def do_controller(self, name):
        """What the drive's controller did, as the API shows it."""
        return controller_view(self.farm.core, self.station(name), time.monotonic_ns())

    def do_events(self, name):
        return [entry.as_dict() for entry in self.farm.log.entries(name)]

    def do_view(self, name):
        """What only the drive's bus has, as in its snapshot."""
        return self.station(name).device.view(time.monotonic_ns())

    def do_fault(self, name, number):
        return self.station(name).raise_fault(number, hold=False)

    def do_inject(self, **fields):
        """An injection by its fields; the time before it, as in a capture."""
        before = time.time()
        self.farm.inject(fields)
        return before

    def do_injections(self):
        return [injection.as_dict() for injection in self.farm.injections.list()]

    def do_clear(self):
        """End every injection; the time after it, as in a capture."""
        self.farm.injections.clear(None, self.farm.now())
        self.farm.poke()
        return time.time()

    def do_abort(self, name, reason):
        station, now = self.station(name), time.monotonic_ns()
        station.device.cm.abort_all(reason, now)
        self.farm.core.settle(station.station, now)

    def do_power(self, name, on):
        station, now = self.station(name), time.monotonic_ns()
        (station.station.power_on if on else station.station.power_off)(now)
        self.farm.core.settle(station.station, now)

    def _settled(self, station, now):
        self.farm.core.settle(station.station, now)
        self.farm.driver.poke()

    def do_diagnosis(self, name, appears, place, **fields):
        """One diagnosis entry comes or goes; ``data`` is hexadecimal."""
        station, now = self.station(name), time.monotonic_ns()
        if "data" in fields:
            fields["data"] = bytes.fromhex(fields["data"])
        if "maintenance" in fields:
            fields["maintenance"] = Maintenance(fields["maintenance"])
        entry = DiagnosisEntry(*place, **fields)
        done = (station.device.cm.diagnosis.add if appears else station.device.cm.diagnosis.remove)(entry)
        self._settled(station, now)
        return done

    def do_alarm(self, name, kind, place, high=False):
        station, now = self.station(name), time.monotonic_ns()
        told = station.device.cm.alarm(kind, tuple(place), now, high=high)
        self._settled(station, now)
        return len(told)

    def do_pull(self, name, slot, subslot=None):
        station, now = self.station(name), time.monotonic_ns()
        pull_module(station.device, slot, subslot, now)
        self._settled(station, now)

    def do_plug(self, name, slot, ident=None):
        station, now = self.station(name), time.monotonic_ns()
        plug_module(station.device, slot, now, ident=ident)
        self._settled(station, now)

    def do_ready_delay(self, name, nanoseconds):
        self.station(name).device.connections.ready_delay = lambda *_: nanoseconds


class PlcWorker:
    def __init__(self, path):
        self.plc = Plc(load_farm(path), log=EventLog(quiet=True))

    async def __aenter__(self):
        await self.plc.open()
        return self

    async def __aexit__(self, *_):
        try:
            await self.plc.release()
        finally:
            await self.plc.close()

    def wait(self):
        return self.plc.wait()

    async def do_wait_connected(self, seconds):
        return await self.plc.wait_connected(seconds)

    async def do_wait_running(self, seconds):
        return await self.plc.wait_running(seconds)

    def do_summary(self):
        return list(self.plc.summary())

    def do_events(self, name):
        return [entry.as_dict() for entry in self.plc.log.entries(name)]

    async def do_release(self):
        return await self.plc.release()

    def _machine(self, name):
        return next(s for s in self.plc.core.sessions if s.plan.name == name)

    async def do_read(self, name, index, api=0x3A00, slot=1, subslot=1, length=4096):
        return await self._record(
            name, lambda machine, tag: machine.read_record(tag, api, slot, subslot, index, length)
        )

    async def do_read_implicit(self, name, index, api=0, slot=0, subslot=1, length=4096):
        return await self._record(
            name, lambda machine, tag: machine.read_implicit(tag, api, slot, subslot, index, length)
        )

    async def do_write(self, name, index, data, api=0x3A00, slot=1, subslot=1):
        octets = bytes.fromhex(data)
        return await self._record(
            name, lambda machine, tag: machine.write_record(tag, api, slot, subslot, index, octets)
        )

    def do_outputs(self, name, slot, subslot, data):
        """The controller sends a submodule these octets."""
        outputs, _ = self._machine(name).plan.plain
        self.plc.core.plain[name][0].write({outputs.places[slot, subslot].place: bytes.fromhex(data)})

    async def _record(self, name, ask):
        session, core = self._machine(name), self.plc.core
        tag = object()
        core.records.clear()
        ask(session.machine, tag)
        core.touch(session, time.monotonic_ns())
        self.plc.driver.poke()
        for _ in range(int(ANSWER_SECONDS / 0.005)):
            for _, event in core.records:
                if event.tag is tag:
                    status = None if event.status is None else int(event.status)
                    return {"status": status, "data": getattr(event, "data", None), "reason": event.reason}
            await asyncio.sleep(0.005)
        raise TimeoutError("the record was not answered")


WORKERS = {"farm": FarmWorker, "plc": PlcWorker}


async def lines():
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while line := await reader.readline():
        yield json.loads(line)


def say(**what):
    print(json.dumps(plain(what)), flush=True)


async def answer(worker):
    async for request in lines():
        verb = request.pop("do")
        try:
            result = getattr(worker, f"do_{verb}")(**request)
            if asyncio.iscoroutine(result):
                result = await result
            say(ok=result)
        except Exception as exc:  # noqa: BLE001 - the one who asked gets it
            traceback.print_exc()
            say(error=f"{type(exc).__name__}: {exc}")


async def main():
    kind, path = sys.argv[1:3]
    farm_module.model_of = tailored
    try:
        async with WORKERS[kind](path) as worker:
            say(ok="up")
            asked, failed = asyncio.ensure_future(answer(worker)), asyncio.ensure_future(worker.wait())
            done, _ = await asyncio.wait({asked, failed}, return_when=asyncio.FIRST_COMPLETED)
            failed.cancel()
            asked.cancel()
            for task in done:
                task.result()
    except PnfarmError as exc:
        say(error=f"{type(exc).__name__}: {exc}")
        raise


if __name__ == "__main__":
    asyncio.run(main())
