"""What controllers found, configured and refused: a right PLC, and wrong ones on all three buses."""

import asyncio
from dataclasses import replace
from ipaddress import IPv4Address

import pytest
from device_cell import CONFIGS, CONTROLLER, DRIVES, HEAD, ISLAND, ONE, Cell, parse
from shared_line import SharedLine
from slave_cell import CONTROLLER as MASTER
from slave_cell import ONE as SLAVE
from slave_cell import SlaveCell

from pnfarm.config.device import DeviceConfig
from pnfarm.controller.line import join_controllers
from pnfarm.farm.file.reading import expand_all
from pnfarm.farm.views.readiness import Readiness
from pnfarm.protocols.profibus.wire.dp import PrmStatus
from pnfarm.protocols.profibus.wire.telegram import Sap, Telegram, emit_telegram
from pnfarm.station.event_log import EventLog
from pnfarm.station.visits import Caller
from pnfarm.wire.arp import OPERATION_REQUEST, ArpPacket, emit_arp

EDS = (CONFIGS / "eds" / "Example-Weigher-20261128.eds").read_text("utf-8")
EIP = "devices:\n  - name: weigher\n    eds: %s\n    ip: 10.77.0.61/24\n"


SCANNER = "controller: {name: plc, ip: 10.77.0.1/24, reconnect: {after: 300ms}%s}\n"


class Mistaken(Cell):
    """A farm by ``text``, with the controller of another one, whose text is ``planned``."""

    def __init__(self, text, planned, tail=CONTROLLER):
        super().__init__(text, controller=None)
        config = parse(HEAD + planned + tail % "")
        stations = expand_all(config)
        drives = [one for one in stations if not isinstance(one, DeviceConfig)]
        devices = [one for one in stations if isinstance(one, DeviceConfig)]
        self.joined = asyncio.run(join_controllers(self.world, config, drives, EventLog(quiet=True), None, devices))
        self.world.run(3.0)


def view(cell):
    found = Readiness(cell.farm)
    assert found.update(1000)
    return found.view(cell.world.now)


def of(seen, name):
    return next(one for one in seen["stations"] if one["name"] == name)


def refusals(station):
    return [one for visit in station["visits"] for one in visit["refusals"]]


def line(text, word):
    """The number of the line of a farm file, behind its head, that holds ``word``."""
    return next(n for n, one in enumerate((HEAD + text).splitlines(), 1) if word in one)


# -- everything is right


@pytest.mark.parametrize(
    ("cell", "text", "steps"),
    [
        (Cell, DRIVES + ONE, ["searched", "connected", "parameters", "ready", "data"]),
        (SlaveCell, SLAVE, ["searched", "connected", "parameters", "data"]),
    ],
)
def test_with_a_right_controller_every_station_is_ready_and_nothing_is_refused(cell, text, steps):
    cell = cell(text)
    cell.connect()
    seen = view(cell)
    assert seen["ready"]
    assert {one["state"] for one in seen["stations"]} == {"ready"}
    assert [visit["state"] for one in seen["stations"] for visit in one["visits"]] == ["data"] * len(seen["stations"])
    assert all(list(one["visits"][0]["steps"]) == steps for one in seen["stations"])
    (controller,) = seen["controllers"]
    assert controller["exchanging"] == controller["stations"] == len(seen["stations"])
    assert not refusals(of(seen, "island"))
    assert seen["missing"] == []


def test_a_station_that_no_controller_asks_for_is_unseen_and_the_farm_is_not_ready():
    cell = Cell(ONE, controller=None)
    cell.world.run(1.0)
    seen = view(cell)
    assert (of(seen, "island")["state"], of(seen, "island")["line"], seen["ready"]) == ("unseen", 4, False)
    assert seen["controllers"] == []


# -- PROFINET


def test_a_wrong_module_is_named_with_the_line_of_its_slot():
    text = ONE.replace("slots: {1: 16DI, 2:", "slots:\n      1: 8DO\n      2:").replace(
        "}, 3: EX-AI-4, 4: FDI4}", "}\n      3: EX-AI-4\n      4: FDI4"
    )
    seen = view(Mistaken(text, ONE))
    island = of(seen, "island")
    assert island["state"] == "partly"
    assert not seen["ready"]
    first = refusals(island)[0]
    assert "slot 1: the controller expects module 0x" in first["text"]
    assert "(DI16)" in first["text"]
    assert "(DO8) is plugged" in first["text"]
    assert (first["key"], first["line"]) == ("devices[0].slots.1", line(text, "1: 8DO"))
    assert first["file"].endswith("cell.pnfarm.yml")


def test_an_empty_slot_is_refused_with_the_key_above_it():
    text = ONE.replace(", 4: FDI4}", "}")
    (found,) = [one for one in refusals(of(view(Mistaken(text, ONE)), "island")) if one["place"] == "4"]
    assert found["text"].endswith("the slot is empty")
    assert "(FDI4)" in found["text"]
    assert (found["key"], found["line"]) == ("devices[0].slots.4", line(text, "slots:"))


def test_a_refusal_goes_when_the_controller_gets_further_and_with_a_power_cycle():
    cell = Mistaken(ONE.replace(", 4: FDI4}", "}"), ONE)
    assert refusals(of(view(cell), "island"))
    station = cell.farm.station("island")
    before = station.visits.revision
    station.power_off(cell.world.now)
    seen = view(cell)
    assert (of(seen, "island")["state"], of(seen, "island")["visits"]) == ("off", [])
    assert station.visits.revision > before


def test_another_access_point_is_named_with_its_key():
    text = ONE.replace("access_point: DAP 1", "access_point: DAP 2")
    found = [one for one in refusals(of(view(Mistaken(text, ONE)), "island")) if one["place"] in {"0", ""}]
    assert found[0]["key"] == "devices[0].access_point"
    assert found[0]["line"] == line(text, "access_point")


def test_a_controller_with_another_makers_file_names_both_devices_and_the_file(tmp_path):
    other = tmp_path / "GSDML-V2.35-Example-Island-20261128.xml"
    other.write_text((CONFIGS / ISLAND).read_text("utf-8").replace('DeviceID="0x1517"', 'DeviceID="0x1518"'), "utf-8")
    island = of(view(Mistaken(ONE, ONE.replace(ISLAND, str(other)))), "island")
    (found,) = refusals(island)
    assert "expects device 0x1518 of vendor 0xFEED, this is device 0x1517 of vendor 0xFEED" in found["text"]
    assert (island["state"], found["works"], found["key"]) == ("refused", False, "devices[0].gsdml")
    assert found["line"] == line(ONE, "gsdml:")


def test_a_name_that_no_station_has_is_missing_with_the_nearest_and_its_line():
    cell = Mistaken(ONE.replace("name: island", "name: island-2"), ONE)
    seen = view(cell)
    (missing,) = seen["missing"]
    assert (missing["name"], missing["nearest"], missing["key"], missing["line"]) == (
        "island", "island-2", "devices[0].name", 4,
    )  # fmt: skip
    assert seen["controllers"][missing["controller"]]["mac"]
    assert of(seen, "island-2")["state"] == "unseen"
    # it has the name by now
    cell.device("island-2").dcp.name = "island"
    assert view(cell)["missing"] == []


def test_names_are_bounded_and_forgotten_when_nobody_asks_for_them():
    cell = Cell(ONE, controller=None)
    absent = cell.farm.segments["profinet"].absent
    for n in range(200):
        absent.note(f"island-{n}", Caller(mac=bytes(6)), cell.world.now)
    found = Readiness(cell.farm)
    found.update(1000)
    assert len(found.view(cell.world.now)["missing"]) == 64
    # the nearest is found for some of them in each view
    for _ in range(8):
        missing = found.view(cell.world.now)["missing"]
    assert {one["nearest"] for one in missing} == {"island"}
    cell.world.run(61.0)
    assert view(cell)["missing"] == []


@pytest.mark.parametrize(
    ("limits", "state", "word"), [("strict", "refused", "refused"), ("lax", "ready", "taken though")]
)
def test_a_wrong_record_of_the_start_up_is_named_with_what_its_file_allows(limits, state, word):
    cell = Cell(f"{ONE}    limits: {limits}\n")
    (session,) = cell.plc.sessions
    records = [replace(one, data=b"\x07\0") if one.slot == 2 else one for one in session.plan.records]
    session.plan = replace(session.plan, records=tuple(records))
    cell.world.run(3.0)
    island = of(view(cell), "island")
    (found,) = refusals(island)
    assert found["text"].startswith(f"parameters of submodule 2.0x0001 {word}")
    assert found["text"].endswith("record 1, Substitute: 7 is written, allowed is 0..2")
    assert (found["place"], found["works"]) == ("2.1", limits == "lax")
    assert found["key"] == ("devices[0].limits" if limits == "strict" else "")
    assert island["state"] == state


def test_what_a_fault_refuses_has_no_line_in_the_farm_file():
    cell = Cell(ONE)
    cell.farm.injections.inject({"kind": "record-error", "on": "island"}, cell.world.now)
    cell.farm.injections.inject({"kind": "module-missing", "on": "island", "params": {"slot": 3}}, cell.world.now)
    cell.world.run(3.0)
    found = refusals(of(view(cell), "island"))
    assert {one["key"] for one in found} == {""}
    assert len(found) == 4
    assert "which was pulled or exchanged since power-on" in next(one for one in found if one["place"] == "3")["text"]


def test_two_controllers_are_told_apart_and_each_has_its_own_way():
    text = """
farm: shared
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.0.0.11/23}
controller: {ip: 10.0.0.1/23}
"""
    shared = SharedLine(text, [lambda _: True, lambda _: True])
    shared.run(3.0)
    seen = view(shared)
    assert [one["name"] for one in seen["controllers"]] == ["plc-0", "plc-1"]
    first, second = of(seen, "axis-01")["visits"]
    assert (first["controller"], first["state"], first["refusals"]) == (0, "data", [])
    # the drive takes one controller
    assert (second["controller"], second["state"], list(second["steps"])) == (1, "refused", ["searched"])
    (found,) = second["refusals"]
    assert "ARs that exist already: 1" in found["text"]
    assert found["count"] > 1
    assert of(seen, "axis-01")["state"] == "partly"


# -- PROFIBUS

SLOTS = SLAVE[: SLAVE.index("    signals")]


@pytest.mark.parametrize(
    ("planned", "key", "words"),
    [
        (SLOTS.replace("1: 16DI", "1: 4AI"), "devices[0].slots.1", ("difference is in slot 1, where 4AI would fit",)),
        (SLOTS.replace("      4: Counter\n", ""), "devices[0].slots.4", ("Chk_Cfg refused", "slot 4")),
        (SLOTS + "      5: 8DO\n", "devices[0].slots.5", ("slot 5, where 8DO would fit",)),
    ],
)  # fmt: skip
def test_a_slave_names_the_slot_whose_identifiers_its_master_has_otherwise(planned, key, words):
    # with strict limits its Set_Prm is refused before
    island = of(view(Mistaken(SLAVE + "    limits: lax\n", planned, MASTER)), "island")
    assert island["state"] == "refused"
    found = next(one for one in refusals(island) if not one["works"])
    assert all(word in found["text"] for word in words), found
    assert found["key"] == key
    assert found["line"]
    assert island["visits"][0]["controller"] == 0


def test_a_slave_with_another_ident_number_names_its_file():
    cell = SlaveCell(SLAVE, controller=None)
    cell.world.run(0.1)
    octets = bytes([PrmStatus.LOCK_REQ, 1, 1, 11, 0x12, 0x34, 0])
    telegram = Telegram(5, 1, 0x6D, Sap.SET_PARAMETERS, Sap.MASTER, octets)
    cell.farm.receive(cell.farm.station("island").port.index, emit_telegram(telegram), cell.world.now)
    (found,) = refusals(of(view(cell), "island"))
    assert "Set_Prm refused: ident number" in found["text"]
    assert (found["key"], found["line"]) == ("devices[0].gsd", line(SLAVE, "gsd:"))


def test_a_master_that_asks_for_another_address_misses_it():
    seen = view(Mistaken(SLAVE, SLAVE.replace("address: 5", "address: 7"), MASTER))
    (missing,) = seen["missing"]
    assert (missing["name"], missing["bus"]) == ("7", "profibus")
    assert seen["controllers"][missing["controller"]]["address"] == "1"


# -- EtherNet/IP


@pytest.fixture
def eds(tmp_path):
    """A path of the file, changed."""

    def write(before, after):
        path = tmp_path / "other.eds"
        assert before in EDS
        path.write_text(EDS.replace(before, after), "utf-8")
        return str(path)

    return write


def test_with_a_right_scanner_a_device_is_ready():
    cell = Mistaken(EIP % "eds/Example-Weigher-20261128.eds", EIP % "eds/Example-Weigher-20261128.eds", SCANNER)
    seen = view(cell)
    assert seen["ready"]
    (visit,) = of(seen, "weigher")["visits"]
    assert list(visit["steps"]) == ["searched", "connected", "data"]
    assert visit["cycle_seconds"]
    assert visit["watchdog_seconds"]


@pytest.mark.parametrize(
    ("before", "after", "key", "words"),
    [
        (", 32, Param1, 32, Param11;", ", 32, Param1;", "devices[0].sizes", ("and 10 from it", "would fit")),
        ("24 64 2C 65 2C 66", "24 64 2C 65 2C 69", "devices[0].eds", ("it asks for assemblies 100, 101, 105",)),
        ("ProdCode = 17;", "ProdCode = 18;", "devices[0].eds", ("type 43, product 18", "type 43, product 17")),
    ],
)  # fmt: skip
def test_a_refused_forward_open_says_what_is_expected_and_what_is_there(eds, before, after, key, words):
    text = EIP % "eds/Example-Weigher-20261128.eds"
    weigher = of(view(Mistaken(text, EIP % eds(before, after), SCANNER)), "weigher")
    assert weigher["state"] == "refused"
    (found,) = refusals(weigher)
    assert all(word in found["text"] for word in words), found["text"]
    assert (found["key"], found["line"]) == (key, line(text, "eds:" if key.endswith("eds") else "name: weigher"))


def test_an_address_that_a_scanner_looks_for_in_vain_is_missing():
    cell = Cell(EIP % "eds/Example-Weigher-20261128.eds", controller=None)
    for target in ("10.77.0.62", "10.77.0.61", "10.78.0.1"):
        packet = ArpPacket(OPERATION_REQUEST, bytes.fromhex("020000000009"), IPv4Address("10.77.0.9"), bytes(6),
                           IPv4Address(target))  # fmt: skip
        cell.farm._audience(b"\xff" * 6 + packet.sender_mac + b"\x08\x06" + emit_arp(packet))
    (missing,) = view(cell)["missing"]
    assert (missing["name"], missing["bus"]) == ("10.77.0.62", "ethernetip")
