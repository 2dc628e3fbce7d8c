"""A kind is one file that is found; a drive takes it if it has the parts that the kind needs."""

import importlib
import inspect
import sys

import pytest
import toy_kinds
from fault_line import FaultLine
from kinds_of import fits
from storm import MODELS, empty_line

from pnfarm.buses.registry import BUSES, bus, fault_kinds
from pnfarm.errors import ConfigError, InternalError
from pnfarm.faults import kinds as neutral_kinds
from pnfarm.faults.catalogue import Catalogue, kinds_in
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.gate.gate import GatedLink
from pnfarm.faults.kind import InjectionKind, KindOnBus, ParamSpec
from pnfarm.faults.manager import InjectionManager
from pnfarm.links.memory import MemoryLink, MemorySwitch

#: Kinds that a drive on a network can have; those of drives on a line alone are tried there.
ON_A_NETWORK = [kind for kind in fault_kinds().values() if any(fits(kind, name) for name in MODELS)]
FIELDS = {"drive-fault": {"fault": 702}, "drive-warning": {"warning": 107}, "digital-input": {"input": 0}}


def test_a_kind_in_a_file_of_its_own_is_injected_and_taken_back():
    line = FaultLine()
    line.connect()
    line.enable()
    catalogue = Catalogue([*fault_kinds().values(), *kinds_in(toy_kinds)])
    manager = InjectionManager(catalogue, {"axis-01": line.faults.drive("axis-01")}, [line.farm.link])
    fields = {"kind": "hiccup", "on": "all", "params": {"pause": "100ms"}, "for": "950ms"}
    injection = manager.inject(fields, line.world.now)
    lost = []
    for _ in range(120):
        line.run(0.01)
        manager.handle_timeout(line.world.now)
        lost.append(not line.plc.all_running)
    assert injection.state == "ended"
    assert injection.evidence().activations == 5
    assert any(lost)
    assert manager.activations() == {("hiccup", "axis-01"): 5}
    assert not line.faults.drive("axis-01").in_force()
    line.enable()
    assert catalogue["hiccup"].as_dict()["params"]["pause"]["default"] == "200ms"
    with pytest.raises(InjectionError, match="'hiccup' is not a kind of fault"):
        line.add("hiccup")


def test_each_file_of_a_package_of_kinds_is_found_in_the_order_of_its_name():
    found = [kind.name for kind in kinds_in(neutral_kinds)]
    assert found[:6] == ["ar-abort", "undervoltage", "encoder-error", "following-error", "sto", "connect-refuse"]
    assert {"loss", "silence", "f702", "power-cycle"} < set(found)


def test_a_file_without_a_kind_is_reported(tmp_path, monkeypatch):
    package = tmp_path / "empty_kinds"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "nothing.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "empty_kinds", raising=False)
    with pytest.raises(InternalError, match=r"empty_kinds\.nothing declares no KIND"):
        kinds_in(importlib.import_module("empty_kinds"))


def test_two_kinds_of_one_name_and_an_unknown_family_are_reported():
    (kind,) = kinds_in(toy_kinds)
    with pytest.raises(InternalError, match="two kinds of injections named hiccup"):
        Catalogue([kind, kind])
    stray = InjectionKind("stray", "weather", "Rain.", "a drop", kind.effect)
    with pytest.raises(InternalError, match="stray is of the family 'weather'"):
        Catalogue([stray])


@pytest.mark.parametrize("name", BUSES)
def test_kinds_of_a_bus_are_in_its_folder_and_need_parts_of_its_drives(name):
    kinds = tuple(bus(name).fault_kinds())
    assert kinds
    for kind in kinds:
        needed = {part for part in kind.effect.needs if part not in {CONNECTION, SERVO}}
        assert needed, f"{kind.name} needs nothing that only drives on {name} have"
        assert inspect.getmodule(kind.effect).__name__.startswith(f"pnfarm.buses.{name}.")


def test_an_unknown_bus_is_reported():
    with pytest.raises(ConfigError, match="there is no bus 'token-ring'; there are profinet"):
        bus("token-ring")


def manager_of(drive: InjectedDrive) -> InjectionManager:
    gate = GatedLink(MemoryLink(MemorySwitch(), lambda: 0), lambda: 0)
    return InjectionManager(fault_kinds(), {drive.name: drive}, [gate])


@pytest.mark.parametrize("kind", ON_A_NETWORK, ids=lambda kind: kind.name)
def test_a_drive_with_the_parts_that_a_kind_needs_takes_it_and_one_without_any_refuses_it(kind):
    line = empty_line(kind)
    whole = line.faults.drive("axis-01")
    parts = {part: whole.part(part) for part in kind.effect.needs}
    fields = {"kind": kind.name, "on": "all", "params": FIELDS.get(kind.name, {})}
    drive = InjectedDrive("axis-01", lambda: whole.names, whole.models, parts, lambda: None)
    manager = manager_of(drive)
    (injection,) = [manager.inject(fields, line.world.now)]
    manager.clear(injection.id, line.world.now)
    for missing in parts:
        some = {part: found for part, found in parts.items() if part is not missing}
        poor = InjectedDrive("axis-07", lambda: ("axis-07",), whole.models, some, lambda: None)
        with pytest.raises(InjectionError) as caught:
            manager_of(poor).inject(fields, line.world.now)
        assert str(caught.value) == f"fault.kind: axis-07 has no {missing.title}, which {kind.name} needs"


def test_a_drive_without_a_connection_cannot_count_its_cycles():
    line = FaultLine()
    parts = {SERVO: line.faults.drive("axis-01").part(SERVO)}
    drive = InjectedDrive("axis-07", lambda: ("axis-07",), (), parts, lambda: None)

    class Still(Effect):
        servo = SERVO

    kind = InjectionKind("still", "drive", "Nothing.", "nothing", Still, takes=frozenset({"cycles"}))
    gate = GatedLink(MemoryLink(MemorySwitch(), lambda: 0), lambda: 0)
    manager = InjectionManager(Catalogue([kind]), {"axis-07": drive}, [gate])
    assert manager.inject({"kind": "still", "on": "all"}, 1).state == "active"
    with pytest.raises(InjectionError, match=r"fault\.cycles: axis-07 has no cyclic connection"):
        manager.inject({"kind": "still", "on": "all", "cycles": 3}, 1)
    with pytest.raises(InjectionError, match=r"fault\.after_cycles: axis-07 has no cyclic connection"):
        manager.inject({"kind": "still", "on": "all", "after_cycles": 3}, 1)


def test_an_effect_that_uses_a_part_that_it_does_not_name_is_a_program_error():
    drive = InjectedDrive("axis-07", lambda: ("axis-07",), (), {}, lambda: None)
    with pytest.raises(InternalError, match="uses servo of axis-07"):
        drive.part(SERVO)


def test_what_is_in_force_applies_to_a_drive_that_booted():
    told, machines = [], [object()]

    class Noted(DrivePart):
        def refresh(self, now):
            told.append(("refresh", now))

        def rebooted(self, now):
            told.append(("rebooted", now))

    shared = Noted()
    one, other = Part("one"), Part("other")
    drive = InjectedDrive("a", lambda: ("a",), (), {one: shared, other: shared}, lambda: machines[-1])
    drive.refresh(1)
    machines.append(object())
    drive.refresh(2)
    drive.refresh(3)
    assert told == [("refresh", 1), ("rebooted", 2), ("refresh", 2), ("refresh", 3)]


@pytest.mark.parametrize("kind", fault_kinds().values(), ids=lambda kind: kind.name)
def test_every_kind_says_what_a_capture_shows_and_what_controllers_report(kind):
    assert kind.doc.endswith(".")
    assert kind.wire.endswith(".")
    assert kind.reports.rstrip(")").endswith(".")
    for on in kind.on.values():
        assert on.wire.endswith(".") or not on.wire
        assert on.reports.rstrip(")").endswith(".") or not on.reports
        assert not on.refused.endswith("."), "a part of a sentence"


@pytest.mark.parametrize("name", BUSES)
def test_a_bus_speaks_of_kinds_that_there_are(name):
    assert set(bus(name).kinds_here()) <= set(fault_kinds())


def test_a_parameter_of_two_buses_is_a_program_error():
    (kind,) = kinds_in(toy_kinds)
    told = {name: {"hiccup": KindOnBus(name, {"code": ParamSpec("number", "One.")})} for name in ("one", "other")}
    with pytest.raises(InternalError, match="hiccup has two parameters code"):
        Catalogue([kind], told)
