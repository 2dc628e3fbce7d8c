"""What cyclic data are worth before the application is ready, and device access that is left alone."""

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.catalogue import model
from pnfarm.table.signals import ZSW1

EVERY = [("akd-profinet", 1, "16ms"), ("akd-profinet-2012", 1, "8ms"), ("hiwin-e1", 3, "1ms"), ("moog-msd", 2, "1ms")]


@pytest.mark.parametrize(("name", "telegram", "cycle"), EVERY)
def test_nothing_is_good_and_no_set_point_counts_before_the_application_is_ready(name, telegram, cycle):
    line = VirtualLine(model=name, telegram=telegram, cycle=cycle)
    station = line.farm.axes[0]
    station.device.connections.ready_delay = lambda *_: None
    session = line.plc.sessions[0]
    assert line.world.run(5.0, until=lambda: session.consumer is not None)
    # a controller that calls its outputs good as soon as it may: STW1 0x0476 leads to S2
    line.plc.columns.image[0].good = 1
    line.run(0.2)
    assert int(line.plc.columns.cpm[session.consumer].received) > 5, "frames come from Connect on"
    assert not line.plc.columns.image[0].valid
    data = [station.device.channels.io_data(d.slot, d.subslot, output=False) for d in station_data(station)]
    assert {entry.iops for entry in data} == {0x40}
    assert int(line.farm.columns.axis[0].drive.state) == 1, "its set points are not taken"
    (ar,) = station.device.cm.ars
    station.device.cm.application_ready(ar.key, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.5)
    assert line.plc.columns.image[0].valid
    assert int(line.plc.columns.image[0].received[ZSW1]) & 1
    assert "submodules changed" not in line.events("axis-01")


def station_data(station):
    (ar,) = station.device.channels.ars.values()
    return [d for _, cr in ar.providers for d in cr.data]


@pytest.mark.parametrize(
    ("name", "telegram"), [(name, number) for name, _, _ in EVERY for number in model(name).profidrive.telegrams]
)
def test_every_telegram_of_a_model_connects_and_exchanges_data(name, telegram):
    cycle = next(cycle for known, _, cycle in EVERY if known == name)
    line = VirtualLine(model=name, telegram=telegram, cycle=cycle)
    line.connect()
    station = line.farm.axes[0]
    assert station.store.telegram_number == telegram
    before = int(line.farm.columns.image[0].frames)
    line.run(0.2)
    assert int(line.farm.columns.image[0].frames) > before
    assert line.plc.columns.image[0].valid
    assert line.plc.sessions[0].measures.losses == 0


def test_application_ready_of_a_connection_that_ended_is_not_repeated():
    line = VirtualLine()
    station = line.farm.axes[0]
    station.device.connections.ready_delay = lambda *_: None
    assert line.world.run(5.0, until=lambda: bool(station.device.channels.ars))
    line.run(0.1)
    (ar,) = station.device.cm.ars
    station.device.cm.application_ready(ar.key, line.world.now)
    station.station.pump(line.world.now)
    assert station.device.client.open_calls == 1
    station.device.cm.abort(ar.key, 31, line.world.now)
    station.station.pump(line.world.now)
    assert station.device.client.open_calls == 0


def test_a_controller_that_leaves_application_ready_unanswered_is_named_so_in_the_log():
    line = VirtualLine()
    line.plc.rpc.receive = lambda *_: None
    lost = []
    assert line.world.run(10.0, until=lambda: lost.extend(aborts(line)) or lost)
    assert lost[0] == "ApplicationReady: no answer"


def aborts(line):
    return [entry.data["reason"] for entry in line.log.entries("axis-01") if entry.event == "ar aborted"]
