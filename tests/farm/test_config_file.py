"""The farm file: what is read, and every wrong thing alone, with its line."""

import sys
from ipaddress import IPv4Interface

import pytest
from farm_file import CONFIGS, GOOD, issues, parse, the_issue

from pnfarm.buses.profinet.config.send_clock import clock_of
from pnfarm.cli.farm_file import check_impairments, known_names
from pnfarm.config.known import catalogue
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, expand, expand_all, load_farm, parse_farm
from pnfarm.table.program import TARGETS

# --- what is read -----------------------------------------------------------------------------------------------


def test_the_promised_example_reads_with_every_value_in_its_unit():
    farm = parse(GOOD)
    group = farm.drives[0]
    assert (farm.farm, farm.link.kind, farm.link.parent, farm.link.send) == (
        "line-1",
        "macvlan",
        "eth1",
        "auto",
    )
    assert (farm.api.host, farm.api.port, farm.api.is_loopback, farm.api.token) == ("127.0.0.1", 8702, True, None)
    assert (group.load.inertia, group.load.friction, group.load.damping, group.load.torque) == (2e-4, 0.05, None, 0.0)
    assert (group.limits, group.params, group.impair, group.telegram) == ("strict", {"DRV.OPMODE": 1}, [], None)


def test_the_example_expands_to_counted_names_addresses_and_stable_macs():
    drives = expand(parse(GOOD))
    assert [drive.name for drive in drives] == [f"axis-{n:02}" for n in range(1, 9)]
    assert drives[0].ip == IPv4Interface("10.77.0.11/24")
    assert drives[7].ip == IPv4Interface("10.77.0.18/24")
    assert [drive.index for drive in drives] == list(range(8))
    macs = [drive.mac for drive in drives]
    assert len(set(macs)) == 8
    assert all(mac[0] == 2 and len(mac) == 6 for mac in macs)
    assert macs == [drive.mac for drive in expand(parse(GOOD))]
    other_farm = [drive.mac for drive in expand(parse(GOOD.replace("line-1", "line-2")))]
    assert not set(macs) & set(other_farm)


def test_an_automatic_mac_depends_on_no_other_drive():
    alone = GOOD.replace("    count: 8\n", "    count: 1\n    start: 5\n")
    assert expand(parse(alone))[0].mac == expand(parse(GOOD))[4].mac


def test_the_state_folder_is_relative_to_the_file(tmp_path):
    assert parse(GOOD, tmp_path / "a" / "line.pnfarm.yml").state_directory == tmp_path / "a" / "state"
    assert parse(GOOD.replace("state: ./state\n", "")).state_directory is None


@pytest.mark.parametrize("word", ["off", "false", "'off'"])
def test_the_api_can_be_switched_off(word):
    assert parse(GOOD.replace("127.0.0.1:8702", word)).api is None


def test_the_api_defaults_to_loopback_and_takes_a_token():
    assert parse(GOOD.replace("api: 127.0.0.1:8702\n", "")).api.listen == ("127.0.0.1", 8702)
    api = parse(GOOD.replace("127.0.0.1:8702", "{listen: '[::]:80', token: long-enough}")).api
    assert (api.host, api.port, api.token, api.is_loopback) == ("::", 80, "long-enough", False)


def test_an_alias_of_a_model_is_expanded_to_its_name():
    assert expand(parse(GOOD.replace("model: akd-profinet", "model: akd")))[0].model == "akd-profinet"


def test_an_explicit_mac_counts_up():
    drives = expand(parse(GOOD.replace("mac: auto", "mac: 02-00-00-00-00-fe")))
    assert [drive.mac.hex(":") for drive in drives[:3]] == [
        "02:00:00:00:00:fe",
        "02:00:00:00:00:ff",
        "02:00:00:00:01:00",
    ]


def test_an_address_without_quotes_is_no_sexagesimal_number():
    assert expand(parse(GOOD.replace("mac: auto", "mac: 10:20:30:40:50:16")))[0].mac.hex() == "102030405016"


def test_a_drive_without_address_waits_for_dcp():
    drive = expand(parse(GOOD.replace("    ip: 10.77.0.11/24\n", "")))[0]
    assert (drive.ip, drive.gateway) == (None, None)


def test_impairments_keep_their_durations_and_targets():
    text = GOOD.replace(
        "impair: []", "impair: [{kind: loss, on: axis-0*, params: {ratio: 0.1}, after: 2s, for: 500ms, seed: 7}]"
    )
    (impairment,) = expand(parse(text))[0].impair
    assert (impairment.kind, impairment.on, impairment.params) == ("loss", ["axis-0*"], {"ratio": 0.1})
    assert (impairment.after_ns, impairment.for_ns, impairment.seed) == (2_000_000_000, 500_000_000, 7)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.pnfarm.yml")), ids=lambda path: path.name)
def test_the_configurations_that_come_with_it_are_valid(path):
    drives = expand_all(load_farm(path))
    assert drives
    assert len({drive.name for drive in drives}) == len(drives)
    macs = [drive.mac for drive in drives if drive.mac]
    assert len(set(macs)) == len(macs)


def test_the_configurations_have_the_drives_that_their_comments_name():
    assert len(expand(load_farm(CONFIGS / "demo.pnfarm.yml"))) == 8
    assert len(expand(load_farm(CONFIGS / "one-drive.pnfarm.yml"))) == 1
    drives = expand(load_farm(CONFIGS / "akd-64.pnfarm.yml"))
    assert len(drives) == 64
    assert str(drives[-1].ip) == "10.77.0.88/24"
    assert drives[-1].params == {"DRV.OPMODE": 1}


# --- each wrong thing alone -------------------------------------------------------------------------------------

WRONG = [
    # text in GOOD, what replaces it, line, field, words of the message, words of what is allowed
    ("farm: line-1", "farm: Line_1", 1, "farm", "'Line_1' is not a farm name", "a-z"),
    ("farm: line-1", "farm: " + "x" * 41, 1, "farm", "is not a farm name", "40 characters"),
    ("farm: line-1", "farm: 7", 1, "farm", "is 7, not a word", "a-z"),
    ("farm: line-1\n", "", 1, "", "neither `farm` nor `controller`", "farm: NAME"),
    ("link: {kind: macvlan, parent: eth1}\n", "", 1, "", "has no `link`", "link:"),
    ("kind: macvlan", "kind: macvaln", 2, "link", "did you mean macvlan?", "macvlan, veth, tap, memory, serial"),
    ("kind: macvlan, ", "", 2, "link", "has no kind", "macvlan, veth, tap, memory"),
    ("{kind: macvlan, parent: eth1}", "eth1", 2, "link", "is 'eth1', not a mapping", "macvlan"),
    (", parent: eth1", "", 2, "link.parent", "is missing", "such as eth1"),
    ("eth1", "a-very-long-interface", 2, "link.parent", "longer than an interface name", "15 octets"),
    ("eth1", "'eth 1'", 2, "link.parent", "is not an interface name", "eth1"),
    (
        "parent: eth1",
        "parent: eth1, send: parrent",
        2,
        "link.send",
        "did you mean parent?",
        "auto, parent, own",
    ),
    ("kind: macvlan, parent: eth1", "kind: veth, parent: eth1", 2, "link.parent", "is not a key here", "kind, bridge"),
    ("state: ./state", "sate: ./state", 3, "sate", "did you mean state?", "farm, link, state"),
    ("state: ./state", "state: ''", 3, "state", "is empty", "relative to this file"),
    ("state: ./state", "state: mysql://farm@db/line", 3, "state", "is a URL of 'mysql'", "postgresql://"),
    ("state: ./state", "state: POSTGRESQL://db/line", 3, "state", "is a URL of 'POSTGRESQL'", "postgresql://"),
    ("127.0.0.1:8702", "8702", 4, "api.listen", "is 8702, not a word", "HOST:PORT"),
    ("127.0.0.1:8702", "127.0.0.1:70000", 4, "api.listen", "70000 is not a TCP port", "65535"),
    ("127.0.0.1:8702", "300.0.0.1:80", 4, "api.listen", "is not a host", "HOST:PORT"),
    (
        "127.0.0.1:8702",
        "{listen: '0.0.0.0:80', token: short}",
        4,
        "api.token",
        "has 5 characters",
        "8 to 512 characters",
    ),
    ("name: axis-{n:02}", "nmae: axis-{n:02}", 6, "drives[0].nmae", "did you mean name?", "name, count"),
    ("axis-{n:02}", "axis-{m}", 6, "drives[0].name", "braces other than", "{n:02}"),
    ("axis-{n:02}", "axis", 6, "drives[0].name", "8 drives cannot all be called 'axis'", "count: 1"),
    ("axis-{n:02}", "Axis-{n}", 6, "drives[0].name", "'Axis-1' is not a station name", "PROFINET"),
    ("axis-{n:02}", "port-{n:03}", 6, "drives[0].name", "'port-001' is not a station name", "PROFINET"),
    ("axis-{n:02}", "10.0.0.{n}", 6, "drives[0].name", "'10.0.0.1' is not a station name", "PROFINET"),
    ("count: 8", "count: 0", 7, "drives[0].count", "is 0", "from 1 to 4094"),
    ("count: 8", "count: eight", 7, "drives[0].count", "is 'eight'", "a whole number from 1 to 4094"),
    ("count: 8", "count: '8'", 7, "drives[0].count", "is '8'", "a whole number"),
    ("count: 8", "count: 8.0", 7, "drives[0].count", "is 8.0", "a whole number"),
    ("count: 8", "count: true", 7, "drives[0].count", "is true", "a whole number"),
    ("count: 8", "count: 5000", 7, "drives[0].count", "is 5000", "4094"),
    ("akd-profinet", "akd-profient", 8, "drives[0].model", "did you mean akd-profinet?", "akd-profinet"),
    ("akd-profinet", "hiwin-e1", 8, "drives[0].model", "is not a model of this version", "akd-profinet"),
    ("10.77.0.11/24", "10.77.0.11", 9, "drives[0].ip", "is not an address with a prefix length", "10.77.0.11/24"),
    ("10.77.0.11/24", "10.77.0.256/24", 9, "drives[0].ip", "is not an address with a prefix length", "10.77.0.11/24"),
    ("10.77.0.11/24", "10.77.0.11/31", 9, "drives[0].ip", "/31 leaves no room", "/30"),
    ("10.77.0.11/24", "10.77.0.0/24", 9, "drives[0].ip", "the address of the network", "10.77.0.1 to 10.77.0.254"),
    ("10.77.0.11/24", "10.77.0.255/24", 9, "drives[0].ip", "the broadcast address", "10.77.0.1 to 10.77.0.254"),
    ("10.77.0.11/24", "10.77.0.250/24", 9, "drives[0].ip", "past the end of 10.77.0.0/24 at 'axis-06'", "10.77.0.254"),
    ("10.77.0.11/24", "224.0.0.5/24", 9, "drives[0].ip", "a multicast address", ""),
    ("10.77.0.11/24", "127.0.0.5/24", 9, "drives[0].ip", "a loopback address", ""),
    ("10.77.0.11/24", "0.0.0.5/24", 9, "drives[0].ip", "no address of a station", ""),
    ("mac: auto", "gateway: 10.78.0.1", 10, "drives[0].gateway", "is not a host of the drives' subnet", "10.77.0.1 to"),
    ("mac: auto", "gateway: 10.77.0.12", 10, "drives[0].gateway", "the address of the drive 'axis-02'", ""),
    ("mac: auto", "gateway: nowhere", 10, "drives[0].gateway", "'nowhere' is not an address", "10.77.0.1"),
    ("ip: 10.77.0.11/24", "gateway: 10.77.0.1", 9, "drives[0].gateway", "is given without `ip`", "ip:"),
    ("mac: auto", "mac: 02:00:00:00:00", 10, "drives[0].mac", "is not a MAC address", "auto"),
    ("mac: auto", "mac: 01:0e:cf:00:00:00", 10, "drives[0].mac", "a multicast address", "unicast"),
    ("mac: auto", "mac: 00:00:00:00:00:00", 10, "drives[0].mac", "zeros", "auto"),
    ("mac: auto", "mac: 02:ff:ff:ff:ff:fe", 10, "drives[0].mac", "up into multicast", "lower"),
    ("inertia: 2.0e-4", "inertia: 0", 11, "drives[0].load.inertia", "is 0", "from 1e-09 to 1000000.0"),
    ("inertia: 2.0e-4", "mass: 5", 11, "drives[0].load", "has a mass or a force", "`lead`, in mm"),
    ("inertia: 2.0e-4", "inertia: .inf", 11, "drives[0].load.inertia", "is inf", "finite"),
    ("inertia: 2.0e-4", "inertai: 2.0e-4", 11, "drives[0].load.inertai", "did you mean inertia?", "friction"),
    (
        "{inertia: 2.0e-4, friction: 0.05}",
        "[1, 2]",
        11,
        "drives[0].load",
        "is a list",
        "a mapping with inertia, friction, ",
    ),
    ("limits: strict", "limits: strickt", 12, "drives[0].limits", "did you mean strict?", "strict, lax"),
    ("identity: {}", "identity: {vndor: 1}", 13, "drives[0].identity.vndor", "is no identity", "vendor"),
    ("DRV.OPMODE: 1", "DRV.OPMODUS: 1", 14, "drives[0].params.DRV.OPMODUS", "is no parameter", "DRV.OPMODE"),
    ("DRV.OPMODE: 1", "DRV.OPMODE: [1]", 14, "drives[0].params.DRV.OPMODE", "is a list", "a number or a word"),
    ("DRV.OPMODE: 1", "DRV.OPMODE: ~", 14, "drives[0].params.DRV.OPMODE", "is nothing", "a number or a word"),
    ("DRV.OPMODE: 1", "DRV.OPMODE: .nan", 14, "drives[0].params.DRV.OPMODE", "is nan", "finite"),
    ("impair: []", "impair: [{kind: los}]", 15, "drives[0].impair[0].kind", "did you mean loss?", "fault kinds"),
    ("impair: []", "impair: [{kind: [x]}]", 15, "drives[0].impair[0].kind", "a list is not a kind", "fault kinds"),
    ("impair: []", "impair: [{}]", 15, "drives[0].impair[0].kind", "is missing", "loss"),
    ("impair: []", "impair: {kind: loss}", 15, "drives[0].impair", "is a mapping", "a list"),
    ("impair: []", "impair: [{kind: loss, after: 3}]", 15, "drives[0].impair[0].after", "has no unit", "500ms"),
    ("impair: []", "impair: [{kind: loss, for: 3 days}]", 15, "drives[0].impair[0].for", "is not a duration", "500ms"),
    ("impair: []", "impair: [{kind: loss, on: []}]", 15, "drives[0].impair[0].on", "is []", "glob"),
    ("impair: []", "impair: [{kind: loss, probability: 2}]", 15, "drives[0].impair[0].probability", "is 2", "to 1"),
    ("impair: []", "telegram: 9", 15, "drives[0].telegram", "akd-profinet has no telegram 9", "1, 7"),
    ("impair: []", "cycle: 15ms", 15, "drives[0].cycle", "the nearest is 8ms or 16ms", "power of two"),
    ("impair: []", "cycle: 1s", 15, "drives[0].cycle", "the nearest is 512ms", "512ms"),
    ("impair: []", "cycle: 8ms", 15, "drives[0].cycle", "faster than akd-profinet can; the nearest is 16ms", "lax"),
]


@pytest.mark.parametrize(("old", "new", "line", "field", "what", "allowed"), WRONG, ids=[f"{w[1][:32]}" for w in WRONG])
def test_one_wrong_thing_gives_one_issue_with_its_line(old, new, line, field, what, allowed):
    assert old in GOOD
    found = issues(GOOD.replace(old, new))
    issue = next(issue for issue in found if issue.field == field)
    assert issue.line == line
    assert what in issue.what
    assert allowed in issue.allowed
    # a misspelt key is also missing where it is required
    assert len(found) == (2 if new.startswith("nmae") else 1)


def test_lax_limits_let_a_fast_cycle_pass():
    fast = GOOD.replace("limits: strict", "limits: lax") + "controller: {cycle: 1ms}\n"
    assert clock_of(parse(fast).controller).cycle_ns == 1_000_000


# --- between drives ---------------------------------------------------------------------------------------------

TWO = """\
farm: two
link: {kind: memory}
drives:
  - name: a-{n}
    count: 4
    model: akd-profinet
    ip: 10.0.0.1/24
    mac: 02:00:00:00:00:01
  - name: b-{n}
    count: 4
    model: akd-profinet
    ip: 10.0.0.5/24
    mac: 02:00:00:00:00:05
"""


def test_groups_that_touch_but_do_not_overlap_are_right():
    assert len(expand(parse(TWO))) == 8


@pytest.mark.parametrize(
    ("old", "new", "line", "field", "what"),
    [
        ("b-{n}", "a-{n}", 9, "drives[1].name", "'a-1' belongs to 'a-1' of drives[0]"),
        ("10.0.0.5/24", "10.0.0.4/24", 12, "drives[1].ip", "'b-1': 10.0.0.4 belongs to 'a-4' of drives[0]"),
        (
            "mac: 02:00:00:00:00:05",
            "mac: 02:00:00:00:00:03",
            13,
            "drives[1].mac",
            "'b-1': 02:00:00:00:00:03 belongs to 'a-3' of drives[0]",
        ),
    ],
)
def test_a_duplicate_is_reported_once_per_group(old, new, line, field, what):
    issue = the_issue(TWO.replace(old, new))
    assert (issue.line, issue.field) == (line, field)
    assert what in issue.what


def test_more_drives_than_a_farm_can_hold_are_refused():
    issue = the_issue(TWO.replace("count: 4", "count: 2048").replace("/24", "/8").replace("10.0.0.5", "10.1.0.0"))
    assert (issue.line, issue.field) == (3, "drives")
    assert "4096 drives" in issue.what


def test_an_automatic_mac_evades_an_explicit_one():
    automatic = expand(parse(TWO.replace("    mac: 02:00:00:00:00:01\n", "")))[0].mac
    text = TWO.replace("    mac: 02:00:00:00:00:01\n", "").replace("02:00:00:00:00:05", automatic.hex(":"))
    assert len({drive.mac for drive in expand(parse(text))}) == 8


# --- all in one -------------------------------------------------------------------------------------------------

ALL_WRONG = """\
farm: Line
link: {kind: macvlna, parent: eth1}
sate: ./state
api: nowhere
realtime: {cpu: -1, fifo: 100}
drives:
  - name: axis-{n}
    count: 8
    count: 9
    model: akd-profinte
    limits: strickt
    ip: 10.0.0.255/24
  - name: axis-{n}
    count: 2
    model: akd-profinet
    cycle: 2ms
    load: {inertia: -1, fricton: 2}
    params: {NOPE: 1, DRV.OPMODE: []}
    impair: [{kind: los}, {kind: loss, after: 3}]
  - 17
controller:
  startup: fast
  program: {kind: sin}
"""


def test_every_error_of_a_file_is_reported_in_one_run_in_the_files_order():
    with pytest.raises(FarmFileError) as caught:
        parse(ALL_WRONG)
    assert [(issue.line, issue.field) for issue in caught.value.issues] == [
        (1, "farm"),
        (2, "link"),
        (3, "sate"),
        (4, "api.listen"),
        (5, "realtime.cpu"),
        (5, "realtime.fifo"),
        (9, "drives[0].count"),
        (10, "drives[0].model"),
        (11, "drives[0].limits"),
        (12, "drives[0].ip"),
        (13, "drives[1].name"),
        (16, "drives[1].cycle"),
        (17, "drives[1].load.inertia"),
        (17, "drives[1].load.fricton"),
        (18, "drives[1].params.NOPE"),
        (18, "drives[1].params.DRV.OPMODE"),
        (19, "drives[1].impair[0].kind"),
        (19, "drives[1].impair[1].after"),
        (20, "drives[2]"),
        (22, "controller.startup"),
        (23, "controller.program.kind"),
    ]
    lines = str(caught.value).splitlines()
    assert len(lines) == len(caught.value.issues)
    assert lines[1] == (
        "line.pnfarm.yml:2: link: 'macvlna' is not a kind of link, did you mean macvlan?; "
        "allowed: kind: macvlan, veth, tap, memory, serial"
    )
    assert isinstance(caught.value, ConfigError)
    assert caught.value.exit_code == 2


def test_the_column_points_at_the_key():
    issue = the_issue(GOOD.replace("friction: 0.05", "frition: 0.05"))
    assert GOOD.splitlines()[issue.line - 1].index("friction") + 1 == issue.column


def test_an_error_in_a_shared_part_points_at_what_was_written():
    text = (
        "farm: a\nlink: {kind: memory}\ndrives:\n"
        "  - &x {name: a, model: akd-profinet, load: {inertia: 1, damping: -1}}\n"
        "  - <<: *x\n    name: b\n"
    )
    found = issues(text)
    assert [(issue.line, issue.field) for issue in found] == [
        (4, "drives[0].load.damping"),
        (4, "drives[1].load.damping"),
    ]


# --- files ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["[1, 2]", "line-1", "7"])
def test_a_file_that_is_no_mapping_is_refused(text):
    assert the_issue(text).line == 1


# --- with the models that are installed -------------------------------------------------------------------------


def test_the_installed_model_judges_parameters_telegrams_and_identity():
    text = GOOD.replace("DRV.OPMODE: 1", "DRV.OPMODE: 77, DRV.OPMODUS: 1, 980: 1").replace(
        "identity: {}", "identity: {vendor: 70000, devise: 1}"
    )
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text + "    telegram: 999\n", "f", catalogue())
    assert [issue.field.removeprefix("drives[0].") for issue in caught.value.issues] == [
        "identity.vendor",
        "identity.devise",
        "params.DRV.OPMODE",
        "params.DRV.OPMODUS",
        "params.980",
        "telegram",
    ]
    assert "did you mean DRV.OPMODE?" in caught.value.issues[3].what


def test_a_list_of_lists_of_telegrams_is_refused_where_it_is():
    with pytest.raises(FarmFileError) as refused:
        parse_farm(GOOD.replace("identity: {}", "identity: {without: [[350]]}"), "f")
    assert "drives[0].identity.without: [350] is not a number" in str(refused.value)


def test_the_installed_model_takes_a_foreign_projects_identity():
    farm = parse_farm(GOOD.replace("identity: {}", "identity: {vendor: 0x0105, device: 7}"), "f")
    assert expand(farm)[0].identity == {"vendor": 0x0105, "device": 7}


def test_a_group_without_a_model_is_still_checked_for_its_names_and_owners_are_named_by_their_place_in_the_file():
    text = """
farm: line
link: {kind: memory}
drives:
  - {name: Axis, modle: akd-profinet}
  - {name: axis-1, model: akd-profinet}
  - {name: axis-1, model: akd-profinet}
"""
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text)
    said = {(issue.line, issue.field): issue.what for issue in caught.value.issues}
    assert "not a station name" in said[5, "drives[0].name"]
    assert said[7, "drives[2].name"].endswith("of drives[1] already")


# --- lengths, and very many errors -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("api: {listen: '0.0.0.0:1', token: secret}", "api.token: has 6 characters; allowed: 8 to 512 characters"),
        ("api: {listen: '0.0.0.0:1', token: 12345678}", "api.token: is not text: put it in quotes; allowed: a word"),
        (f"api: {{listen: '0.0.0.0:1', token: {'s' * 600}}}", "api.token: has 600 characters; allowed: 8 to 512"),
        ("api: {listen: '0.0.0.0:1', token: ''}", "api.token: is empty; allowed: 8 to 512 characters"),
    ],
)
def test_a_wrong_length_is_reported_with_the_lengths_allowed_and_without_the_secret(text, told):
    (found,) = issues(GOOD.replace("api: 127.0.0.1:8702", text))
    assert told in str(found)
    assert "secret" not in str(found)
    assert "sss" not in str(found)


def test_a_list_with_a_wrong_length_is_reported_with_its_entries():
    program = "controller:\n  name: plc\n  program: {kind: positions, targets: [%s]}\n"
    (found,) = issues(GOOD + program % ", ".join("1.0" for _ in range(40)))
    assert f"targets: has 40 entries; allowed: 1 to {TARGETS} entries" in str(found)
    (found,) = issues(GOOD + program % "")
    assert f"targets: is empty; allowed: 1 to {TARGETS} entries" in str(found)


HEAD = "farm: a\nlink: {kind: veth}\ndrives:\n"
ONE = HEAD + "  - name: a\n    model: akd-profinet\n"
#: What is wrong very often -> a file with so many errors of that kind.
MANY = {
    "unknown keys of groups": lambda n: HEAD + "".join(f"  - {{name: a{i}, model: akd, x{i}: 1}}\n" for i in range(n)),
    "unknown keys": lambda n: ONE + "".join(f"    key{i}: 1\n" for i in range(n)),
    "unknown parameters": lambda n: ONE + "    params:\n" + "".join(f"      DRV.X{i}: 1\n" for i in range(n)),
    "parameters of the wrong type": lambda n: ONE + "    params:\n" + "".join(f"      DRV.X{i}:\n" for i in range(n)),
    "counts": lambda n: HEAD + "".join(f"  - {{name: a{i}, model: akd-profinet, count: x}}\n" for i in range(n)),
    "models": lambda n: HEAD + "".join(f"  - {{name: a{i}, model: akd-profine{i}}}\n" for i in range(n)),
    "the same name": lambda n: HEAD + "  - {name: a, model: akd-profinet}\n" * n,
    "impairments": lambda n: ONE + "    impair:\n" + "".join(f"      - {{kind: loss{i}}}\n" for i in range(n)),
    "impairments' parameters": lambda n: (
        ONE + "    impair:\n" + "".join(f"      - {{kind: loss, params: {{x{i}: 1}}}}\n" for i in range(n))
    ),
    "sections": lambda n: "".join(f"zz{i}: 1\n" for i in range(n)),
}


def work(text, path):
    """How many errors there are, and how many calls of functions it took to find them: the same on every machine."""
    path.write_text(text)
    calls = 0

    def count(_frame, event, _argument):
        nonlocal calls
        calls += event in {"call", "c_call"}

    known = known_names()
    before = sys.getprofile()
    sys.setprofile(count)
    try:
        check_impairments(load_farm(path, known))
    except FarmFileError as error:
        return len(error.issues), calls
    finally:
        sys.setprofile(before)
    return 0, calls


@pytest.mark.parametrize("kind", MANY)
def test_twice_as_many_errors_take_twice_the_work(kind, tmp_path):
    path = tmp_path / "many.pnfarm.yml"
    work(MANY[kind](10), path)  # what is loaded once
    few, once = work(MANY[kind](300), path)
    many, twice = work(MANY[kind](600), path)
    assert few >= 299
    assert many >= 599
    # the words that are compared with the known ones are part of both
    assert twice < 2.2 * once


def test_of_very_many_unknown_words_the_first_are_compared_with_the_known_ones(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "pnfarm.vocabulary.quoting.difflib.get_close_matches", lambda word, *_, **__: asked.append(word) or []
    )
    assert len(issues(MANY["unknown parameters"](2_000))) == 2_000
    assert len(asked) <= 100
    assert len(issues(MANY["unknown parameters"](5))) == 5


@pytest.mark.parametrize("own", ["address: 5", "control_unit: 3, gsd: drive.gsd", "rpi: 10ms, ip: 10.77.0.1/24"])
def test_a_drive_without_a_model_is_reported_as_that_whatever_bus_its_other_keys_are_of(own):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(f"farm: line-1\nlink: {{kind: memory}}\ndrives:\n  - {{name: axis-1, {own}}}\n")
    assert "drives[0].model: is missing" in str(caught.value)


def test_an_axis_has_a_name_that_no_other_drive_of_the_farm_has():
    text = """\
farm: line-1
link: {kind: memory}
drives:
  - {name: feeder, model: profidrive, limits: lax, ip: 10.77.0.11/24, axes: [{name: x}, {name: y}]}
  - {name: feeder.x, model: akd-profinet, ip: 10.77.0.12/24}
"""
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text)
    assert "drives[1].name: 'feeder.x' belongs to 'feeder' of drives[0] already" in str(caught.value)
