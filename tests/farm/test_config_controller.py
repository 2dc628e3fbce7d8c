"""The controller of a farm file."""

import pytest
from farm_file import GOOD, parse, the_issue

from pnfarm.buses.profinet.config.send_clock import clock_of
from pnfarm.farm.file.reading import controller_mac, expand

CONTROLLER = GOOD + "controller:\n"


def test_a_controller_has_the_promised_defaults():
    controller = parse(CONTROLLER + "  ip: 10.77.0.1/24\n").controller
    assert (controller.name, controller.watchdog_factor, controller.startup) == ("plc", 3, "legacy")
    assert (controller.assign_ip, controller.telegram, controller.program.kind) == (True, 1, "idle")
    assert controller.reconnect.after_ns == 1_000_000_000
    clock = clock_of(controller)
    assert (clock.send_clock_factor, clock.reduction_ratio, clock.cycle_ns) == (32, 16, 16_000_000)


@pytest.mark.parametrize(
    ("keys", "clock"),
    [
        ("cycle: 128ms", (32, 128)),
        ("cycle: 16ms\n  send_clock_factor: 128", (128, 4)),
        ("send_clock_factor: 64", (64, 8)),
        ("reduction_ratio: 32", (32, 32)),
        ("cycle: 16ms\n  reduction_ratio: 8", (64, 8)),
        ("send_clock_factor: 8\n  reduction_ratio: 512", (8, 512)),
    ],
)
def test_what_is_left_out_of_the_clock_follows_from_the_rest(keys, clock):
    made = clock_of(parse(CONTROLLER + f"  {keys}\n").controller)
    assert (made.send_clock_factor, made.reduction_ratio) == clock


def test_a_drive_may_have_a_cycle_of_its_own():
    farm = parse(GOOD.replace("limits: strict", "cycle: 64ms") + "controller:\n  send_clock_factor: 64\n")
    assert clock_of(farm.controller, expand(farm)[0].cycle_ns).reduction_ratio == 32


QUICK = GOOD.replace("akd-profinet", "quick")


@pytest.mark.parametrize(("text", "milliseconds"), [(GOOD, 16), (QUICK, 4), (QUICK.replace("strict", "lax"), 16)])
def test_a_drive_that_cannot_be_run_at_the_usual_cycle_gets_its_slowest(text, milliseconds):
    farm = parse(text + "controller: {}\n")
    assert clock_of(farm.controller, expand(farm)[0].cycle_ns).cycle_ns == milliseconds * 1_000_000


@pytest.mark.parametrize("cycle", ["soon", "3ms", "8ms"])
def test_a_wrong_cycle_is_reported_once_with_fast_drives_too(cycle):
    assert the_issue(QUICK + f"controller: {{cycle: {cycle}}}\n").field == "controller.cycle"


FOREIGN = "controller: {{interface: eth1, watchdog_factor: {}, devices: [{{name: valve, gsdml: valve.xml{}}}]}}\n"


def test_a_devices_own_watchdog_factor_counts_and_not_the_controllers():
    parse(FOREIGN.format(60, ", cycle: 64ms, watchdog_factor: 3"))
    issue = the_issue(FOREIGN.format(3, ", cycle: 64ms, watchdog_factor: 60"))
    assert (issue.field, issue.line) == ("controller.devices[0].watchdog_factor", 1)
    assert issue.what == "60 cycles of 64ms are too long a watchdog"
    issue = the_issue(FOREIGN.format(60, ", cycle: 64ms"))
    assert (issue.field, issue.what) == ("controller.devices[0].cycle", "60 cycles of 64ms are too long a watchdog")


def test_a_file_for_foreign_devices_needs_no_farm():
    farm = parse(
        "controller: {interface: eth1, cycle: 16ms, reconnect: off,\n"
        "             records: [{slot: 1, subslot: 2, index: 0x10, data: '00 ff'}]}\n"
        "drives: [{name: press, model: akd-profinet, ip: 192.168.0.5/24}]\n"
    )
    assert (farm.farm, farm.link, farm.controller.interface, farm.controller.reconnect) == (None, None, "eth1", None)
    assert farm.controller.records[0].data == b"\x00\xff"
    assert controller_mac(farm, farm.controllers[0]) is None
    assert [drive.name for drive in expand(farm)] == ["press"]


def test_a_controller_on_the_farms_link_gets_a_mac_of_its_own():
    farm = parse(CONTROLLER + "  ip: 10.77.0.1/24\n")
    mac = controller_mac(farm, farm.controllers[0])
    assert mac[0] == 2
    assert mac not in {drive.mac for drive in expand(farm)}
    explicit = parse(CONTROLLER + "  mac: 02:00:00:00:00:09\n")
    assert controller_mac(explicit, explicit.controllers[0]) == bytes.fromhex("020000000009")


WRONG_CONTROLLER = [
    ("name: Plc", "controller.name", "'Plc' is not a station name"),
    ("name: axis-03", "drives[0].name", "'axis-03' belongs to the controller"),
    ("ip: 10.77.0.12/24", "drives[0].ip", "'axis-02': 10.77.0.12 belongs to the controller"),
    ("ip: 10.78.0.1/24", "controller.ip", "cannot reach drives[0]"),
    ("ip: 10.77.0.255/24", "controller.ip", "broadcast"),
    ("interface: eth1", "controller.interface", "does not receive the frames of its macvlans"),
    ("{interface: eth2, link: {kind: memory}}", "controller.interface", "is given beside `link`"),
    ("link: {kind: tun}", "controller.link", "is not a kind of link"),
    ("link: {kind: veth, parent: x}", "controller.link.parent", "is not a key here"),
    ("cycle: 2ms", "controller.cycle", "faster than akd-profinet can"),
    ("cycle: 30ms", "controller.cycle", "the nearest is 16ms or 32ms"),
    ("cycle: 2", "controller.cycle", "has no unit"),
    ("send_clock_factor: 3", "controller.send_clock_factor", "is 3"),
    ("reduction_ratio: 1024", "controller.reduction_ratio", "is 1024"),
    ("{send_clock_factor: 128, reduction_ratio: 512}", "controller.send_clock_factor", "the slowest cycle is 512ms"),
    ("{cycle: 16ms, send_clock_factor: 32, reduction_ratio: 8}", "controller.send_clock_factor", "make 8ms, not 16ms"),
    ("{cycle: 16ms, reduction_ratio: 1}", "controller.reduction_ratio", "a send clock factor is one of 1, 2"),
    ("{cycle: 16ms, send_clock_factor: 4}", "controller.send_clock_factor", "of 4 is not supported by akd-profinet"),
    ("{cycle: 16ms, reduction_ratio: 256}", "controller.reduction_ratio", "of 2 is not supported by akd-profinet"),
    ("{cycle: 512ms, watchdog_factor: 4}", "controller.watchdog_factor", "4 cycles of 512ms are 2.048s"),
    ("watchdog_factor: 0", "controller.watchdog_factor", "is 0"),
    ("startup: fast", "controller.startup", "is 'fast'"),
    ("program: {kind: sin}", "controller.program.kind", "did you mean sine?"),
    ("program: {speed: 5}", "controller.program.speed", "did you mean speed_rpm?"),
    ("records: [{slot: 1, subslot: 2, index: 1, data: xyz}]", "controller.records[0].data", "is not hexadecimal"),
    ("records: [{slot: 1, subslot: 2, data: ''}]", "controller.records[0].index", "is missing"),
    ("reconnect: 7", "controller.reconnect", "is 7"),
    ("reconnect: {after: 0.5ns}", "controller.reconnect.after", "is not a duration"),
]


@pytest.mark.parametrize(("text", "field", "what"), WRONG_CONTROLLER, ids=[w[0] for w in WRONG_CONTROLLER])
def test_one_wrong_thing_of_the_controller_gives_one_issue(text, field, what):
    issue = the_issue(GOOD + "controller: " + (text if text.startswith("{") else "{" + text + "}") + "\n")
    assert issue.field == field
    assert what in issue.what
    assert issue.allowed
    if field.startswith("controller"):
        assert issue.line == 16


def test_a_cycle_that_is_too_fast_for_some_drives_is_refused_with_the_key_that_gives_these_another_one():
    issue = the_issue(GOOD + "controller: {cycle: 2ms}\n")
    assert issue.allowed.startswith("16ms and slower, or `cycle: 16ms` or limits: lax on drives")


def test_a_controller_on_the_parent_is_refused_where_no_frame_would_reach_it():
    text = GOOD.replace("parent: eth1", "parent: eth1, send: parent")
    parse(text)
    issue = the_issue(text + "controller: {}\n")
    assert (issue.line, issue.field) == (2, "link.send")
    parse(text + "controller: {interface: eth2}\n")


def test_a_file_with_neither_farm_nor_controller_says_so():
    issue = the_issue("drives: [{name: a, model: akd-profinet}]\n")
    assert "neither `farm` nor `controller`" in issue.what


def test_a_foreign_file_needs_an_interface():
    issue = the_issue("controller: {cycle: 16ms}\ndrives: [{name: a, model: akd-profinet}]\n")
    assert (issue.line, issue.field) == (1, "controller")


def test_a_link_without_a_farm_is_refused():
    issue = the_issue(GOOD.replace("farm: line-1\n", "") + "controller: {interface: eth2}\n")
    assert (issue.line, issue.field) == (1, "link")
