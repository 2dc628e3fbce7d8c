"""A farm with devices by the example GSD files on one PROFIBUS line, with its master, in virtual time."""

from device_cell import Cell

from pnfarm.protocols.profibus.record_request import RecordRequest

ISLAND = "gsd/EXMP1D01.gsd"
VALVE = "gsd/EXMP1D02.gsd"
CONTROLLER = "controller: {name: plc, cycle: 5ms, watchdog: 100ms, reconnect: {after: 200ms}%s}\n"
ONE = f"""devices:
  - name: island
    gsd: {ISLAND}
    address: 5
    slots:
      0: {{parameters: {{Diagnosis: "off"}}}}
      1: 16DI
      2: {{module: 8DO, parameters: {{Substitute: hold}}}}
      4: Counter
    signals:
      part_present: 1.1.0.3
      count: {{at: 4.1.0, type: uint32}}
      clamp: 2.1.0.0
"""
TWO = ONE + f"  - {{name: valve, gsd: {VALVE}, address: 9}}\n"
DRIVES = "drives:\n  - {name: 'msd-{n}', count: 2, model: moog-msd-dp, address: 11}\n"


class SlaveCell(Cell):
    """A farm from the text of its file, with its master."""

    tail = CONTROLLER

    def inputs(self, name="island"):
        """Data and status of the inputs that the master has."""
        octets, status = self.plc.plain[name][1].whole()
        return octets, bool(status[0])

    def sent(self, octets, name="island"):
        """The master sends these, and some cycles pass."""
        self.plc.plain[name][0].write({0: octets})
        self.world.run(0.1)

    def station(self, name="island"):
        """The master's view of the slave."""
        return self.plc.master.station(name)

    def inject(self, kind, on="island", **fields):
        return self.farm.injections.inject({"kind": kind, "on": on, **fields}, self.world.now)

    def clear(self, seconds=1.5):
        self.farm.injections.clear(None, self.world.now)
        self.world.run(seconds)

    def record(self, slot, index, data=None, name="island"):
        """A record that is read, or written where there are data."""
        asked = RecordRequest.read(slot, index, 64) if data is None else RecordRequest.write(slot, index, data)
        self.plc.master.ask(name, asked, self.world.now)
        self.plc.service(self.world.now)
        assert self.world.run(2.0, until=lambda: asked.done)
        return asked
