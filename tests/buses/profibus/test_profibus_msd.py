"""Chapters of the MSD's manual that hold on both buses, on PROFIBUS: the loss of the bus, its warnings, its lamps."""

from pnfarm.farm.views.snapshot import drive_snapshot

LOST = 1 << 16 | 32


def shown(line, name="msd-01"):
    return drive_snapshot(line.core, line.core.axis(name), line.now_ns)


def fault_of(line):
    fault = shown(line)["fault"]
    return None if fault is None else fault["number"]


def test_8_3_1_p_1283_counts_from_the_last_telegram_where_the_slaves_watchdog_is_longer(farm):
    line = farm(more=", params: {P-1283: 300}", watchdog="5s")
    line.inject("silence", on="msd-01", direction="both", **{"for": "3s"})
    line.run(0.25)
    assert fault_of(line) is None
    assert shown(line)["connected"]
    line.run(0.1)
    assert fault_of(line) == LOST
    assert line.core.axis("msd-01").store.get("P-0953") & 1


def test_8_3_1_p_1283_at_0_raises_no_fault_and_the_outputs_are_zero_all_the_same(farm):
    line = farm(more=", params: {P-1283: 0}")
    line.inject("silence", on="msd-01", direction="both", **{"for": "600ms"})
    line.run(0.3)
    seen = shown(line)
    assert (fault_of(line), seen["connected"]) == (None, False)
    station = line.core.axis("msd-01")
    assert not station.handle.image.received.any()
    assert station.store.get("P-0953") == 1, "the bus timed out"


def test_4_2_1_after_power_on_a_drive_seeks_the_rate_as_one_that_was_never_connected(farm):
    line = farm()
    station = line.core.axis("msd-01")
    line["msd-01"].power_off()
    line.inject("silence", on="msd-01", direction="both")
    line["msd-01"].power_on()
    line.run(0.5)
    assert tuple(shown(line)["lamps"].values()) == ("off", "off", "flashing")
    assert station.store.get("P-0963") == 0, "no rate is known"
