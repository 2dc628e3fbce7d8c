"""The soak in virtual time: its short form, that a seed repeats it, and that it finds what is wrong on purpose."""

import argparse

import pytest

from tests.soak import virtual
from tests.soak.virtual import VirtualRun


def options(seconds, *, seed=1, drives=4, rate=4.0):
    return argparse.Namespace(hours=seconds / 3600, seed=seed, drives=drives, rate=rate, out=None)


def verdict(checks):
    return {check.name: check.ok for check in checks}


@pytest.mark.slow
def test_after_minutes_of_random_faults_every_drive_is_back_and_nothing_is_left(monkeypatch):
    # so many rests that memory and objects are compared
    monkeypatch.setattr(virtual, "ROUND_SECONDS", 8.0)
    monkeypatch.setattr(virtual, "CALM_SECONDS", 4.0)
    run = VirtualRun(options(110.0))
    checks = run.go(tell=False)
    assert {check.ok for check in checks} == {True}, virtual.shown(checks)
    assert {"memory flat", "objects flat", "event stream complete"} <= verdict(checks).keys()
    assert len(run.kinds) > 40
    assert run.losses.by_reason
    assert {
        "fault",
        "invalid",
        "clear",
        "power-cycle",
        "write",
        "wrong-write",
        "trace",
        "scenario",
        "scrape",
    } <= run.done.keys()


@pytest.mark.slow
def test_a_whole_cell_of_three_buses_devices_and_a_plant_is_back_behind_a_rest(monkeypatch):
    monkeypatch.setattr(virtual, "ROUND_SECONDS", 6.0)
    monkeypatch.setattr(virtual, "CALM_SECONDS", 3.0)
    run = VirtualRun(options(6.0, drives=8, rate=6.0))
    checks = run.go(tell=False)
    assert {name for name, ok in verdict(checks).items() if ok is not True} == {"memory flat", "objects flat"}, checks
    assert {"force", "fault"} <= run.done.keys()
    (sample,) = run.report(checks)["samples"]
    assert sample["process rows"] > 50


def test_a_seed_repeats_a_run_entry_for_entry():
    first, again, other = (VirtualRun(options(15.0, seed=seed, drives=2)) for seed in (7, 7, 8))
    for run in (first, again, other):
        run.go(tell=False)
    assert first.stream.entries > 100
    assert (first.digest, first.seconds) == (again.digest, again.seconds)
    assert first.digest != other.digest


@pytest.fixture
def short(monkeypatch):
    """A run of a few virtual seconds with short rests."""
    monkeypatch.setattr(virtual, "ROUND_SECONDS", 3.0)
    monkeypatch.setattr(virtual, "CALM_SECONDS", 2.0)
    monkeypatch.setattr(virtual, "BACK_SECONDS", 12.0)
    return VirtualRun(options(3.0, drives=2))


def test_a_drive_that_stays_away_is_found(short, monkeypatch):
    station = short.line.farm.axes[0]
    monkeypatch.setattr(
        short, "_act", lambda action: station.station.power_off(short.line.world.now) if station.powered else None
    )
    checks = short.go(tell=False)
    assert verdict(checks)["every drive in operation"] is False


def test_a_request_of_the_plc_without_an_answer_is_found(short, monkeypatch):
    monkeypatch.setattr(short, "_act", lambda action: None)
    answered = verdict(short.go(tell=False))["the PLC's requests at a rest answered"]
    monkeypatch.setattr(virtual, "ask", lambda controller, name, now: controller.access_record(name, 0xAFFE, None, now))
    assert (answered, short._ask_all().ok) == (True, False)


def test_a_fault_that_is_left_is_found(short, monkeypatch):
    manager, clear = short.line.faults, short.line.faults.clear
    manager.inject({"kind": "loss", "on": "all", "probability": 0.001, "as": "left"}, short.line.world.now)
    monkeypatch.setattr(short, "_act", lambda action: None)
    monkeypatch.setattr(manager, "clear", lambda name, now: [] if name is None else clear(name, now))
    found = verdict(short.go(tell=False))
    assert found["nothing of the faults left"] is False
    assert found["each injected fault ended"] is False


def test_a_table_row_and_a_subscriber_that_stay_are_found(short, monkeypatch):
    monkeypatch.setattr(short, "_act", lambda action: short.line.log.subscribe(print))
    monkeypatch.setattr("builtins.print", lambda *_, **__: None)
    assert verdict(short.go(tell=False))["the farm holds what it held"] is False


def test_an_entry_that_the_log_loses_is_found(short, monkeypatch):
    log, record = short.line.log, short.line.log.record

    def forgetful(*arguments):
        if log.newest == short.stream.last + 1:
            log._sequence += 1
        return record(*arguments)

    monkeypatch.setattr(log, "record", forgetful)
    monkeypatch.setattr(short.line.farm.log, "record", forgetful)
    assert verdict(short.go(tell=False))["event stream complete"] is False


def test_a_request_that_is_wrong_and_is_accepted_is_found(short, monkeypatch):
    monkeypatch.setattr(short, "_carry_out", lambda action: None)
    short.choices._rng.seed(3)
    assert verdict(short.go(tell=False))["each request answered as it should"] is False
