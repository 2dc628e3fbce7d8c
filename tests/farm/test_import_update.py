"""A farm file that a user has edited, and a second import: what both changed, octet for octet."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable

import pytest
from cell_file import GSDML
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.errors import ConfigError
from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.file.update import Project, update
from pnfarm.vocabulary.yaml_lines import YamlError, parse_yaml

FILE = DescriptionFile("gsdml", str(GSDML), None)


def drive(name, ip, telegram=None):
    keys = {"ip": f"10.7.0.{ip}/24"} | ({} if telegram is None else {"telegram": telegram})
    return FoundDrive(name, "hiwin-e1", keys, (f"IP 10.7.0.{ip}", "a long note " * 12))


def device(name, ip, slots=(), signals=()):
    keys = {"ip": f"10.7.0.{ip}/24", "access_point": "DAP 1"}
    keys |= {"slots": dict(slots)} if slots else {}
    keys |= {"signals": dict(signals)} if signals else {}
    return FoundDevice(name, FILE, keys, (f"IP 10.7.0.{ip}",))


def project(*found):
    made = write_farm(list(found), "cell", "eth1", "p.aml", GSDML.parent)
    return Project(made.text, "p.aml", made.addresses, made.unplayed)


def readable(text):
    return parse_farm(text, GSDML.parent / "cell.pnfarm.yml")


SLOTS = {1: "DI16", 2: "DO8", 3: "AI4"}
SIGNALS = {
    "part": "1.1.0.3", "lamp": "2.1.0.1", "word": {"at": "1.1.0", "type": "uint16"},
    "pressure": {"at": "3.1.2", "type": "int16"}, "flow": {"at": "3.1.4", "type": "int16"},
}  # fmt: skip
CELL = (
    drive("axis-1", 11, 111), drive("axis-2", 12), device("island-1", 41, SLOTS, SIGNALS),
    device("island-2", 42, SLOTS, SIGNALS), FoundStation("plc-1", ("IP 10.7.0.1",)),
)  # fmt: skip


def changed(*replaced, without=()):
    """The cell with other stations of these names, and new ones."""
    by_name = {one.name: one for one in (*CELL, *replaced)}
    return project(*(one for name, one in by_name.items() if name not in without))


def merge(text, now, base=CELL):
    return update(text, project(*base).text, now)


def said(merged):
    return "\n".join(merged.sentences)


# -- a project's changes --------------------------------------------------------------------------------------------


def test_a_station_with_a_comment_and_own_keys_gets_the_project_s_address():
    text = project(*CELL).text.replace(
        "  - name: axis-2\n", "  # watch this one\n  - name: axis-2   # the slow one\n    load: {inertia: 0.001}\n"
    )
    merged = merge(text, changed(drive("axis-2", 22)))
    assert merged.text == text.replace("10.7.0.12", "10.7.0.22")
    assert merged.sentences == ["axis-2: changed: ip"]


def test_what_both_changed_is_kept_as_the_user_has_it_and_listed_with_its_line():
    text = project(*CELL).text.replace("10.7.0.12/24", "10.7.0.99/24")
    merged = merge(text, changed(drive("axis-2", 22)))
    assert "10.7.0.99/24" in merged.text
    assert "10.7.0.22/24" not in merged.text
    line = next(number for number, one in enumerate(text.split("\n"), 1) if "10.7.0.99" in one)
    assert f"axis-2: line {line}: ip '10.7.0.99/24' is kept; the project has '10.7.0.22/24' now" in merged.sentences


def test_modules_and_signals_change_one_by_one():
    text = project(*CELL).text.replace("      lamp:", "      mine: 1.1.0.7   # by hand\n      lamp:", 1)
    text = text.replace("part: 1.1.0.3", "part: {at: 1.1.0.3, metrics: true}", 1)
    slots = {1: "DI16", 2: "DI16", 5: "AI4"}
    signals = {"part": "1.1.0.4", "word": "1.1.0.1", "new": "5.1.0.0"}
    merged = merge(text, changed(device("island-1", 41, slots, signals)))
    (group, _) = readable(merged.text).devices
    assert {slot: one.module for slot, one in group.slots.items()} == slots
    assert {name: one.text for name, one in group.signals.items()} == {
        "mine": "1.1.0.7", "part": "1.1.0.3", "word": "1.1.0.1", "new": "5.1.0.0",
    }  # fmt: skip
    assert "mine: 1.1.0.7   # by hand\n" in merged.text
    assert "signals.part" in said(merged)


def test_a_renamed_signal_stays_renamed():
    text = project(*CELL).text.replace("      part:", "      part_present:", 1)
    assert merge(text, changed()).text == text
    moved = device("island-1", 41, SLOTS, {**SIGNALS, "part": "1.1.0.4"})
    merged = merge(text, changed(moved))
    assert merged.text == text
    assert "signals.part: you removed it or named it part_present" in said(merged)


def test_new_stations_are_added_behind_those_before_them():
    text = project(*CELL).text.replace("axis-1\n", "axis-1\n    limits: lax\n")
    more = drive("axis-0", 10), *CELL[:1], drive("axis-3", 13), *CELL[1:], device("valve", 43, SLOTS)
    merged = merge(text, project(*more))
    config = readable(merged.text)
    assert [group.name for group in config.drives] == ["axis-0", "axis-1", "axis-3", "axis-2"]
    assert [group.name for group in config.devices] == ["island-1", "island-2", "valve"]
    assert merged.text == project(*more).text.replace("axis-1\n", "axis-1\n    limits: lax\n")
    assert merged.sentences == ["axis-0: added", "axis-3: added", "valve: added"]


def test_the_first_device_of_a_project_makes_the_list():
    base = CELL[0], CELL[-1]
    text = project(*base).text + "state: ./state\n"
    merged = merge(text, project(CELL[0], CELL[2], CELL[-1]), base)
    assert [group.name for group in readable(merged.text).devices] == ["island-1"]
    assert merged.text.startswith(project(CELL[0], CELL[2]).text)
    assert merged.text.endswith("state: ./state\n")


def test_a_station_that_is_gone_is_removed_or_made_a_comment_if_the_user_had_changed_it():
    text = project(*CELL).text.replace("axis-2\n", "axis-2   # slow\n    load: {inertia: 0.001}\n")
    text += "controller: {name: plc, ip: 10.7.0.1/24}\n"
    merged = merge(text, changed(without=("axis-2", "island-1")))
    assert [one.name for one in (*readable(merged.text).drives, *readable(merged.text).devices)] == [
        "axis-1", "island-2",
    ]  # fmt: skip
    assert "  # - name: axis-2   # slow\n  #   load: {inertia: 0.001}\n  #   model: hiwin-e1\n" in merged.text
    assert "island-1" not in merged.text
    assert "axis-2: gone from the project: made a comment" in merged.sentences
    assert "island-1: gone from the project: removed, as you had changed nothing in it" in merged.sentences


def test_the_last_device_that_is_gone_takes_its_list_along():
    for edit in ("", "      mine: 1.1.0.6\n"):
        text = project(*CELL).text.replace("      lamp:", f"{edit}      lamp:")
        merged = merge(text, changed(without=("island-1", "island-2")))
        assert readable(merged.text).devices == []
        assert ("mine: 1.1.0.6" in merged.text) == bool(edit)
        assert ("\n# devices:\n" in merged.text) == bool(edit)


def test_a_station_that_cannot_be_made_now_is_kept():
    text = project(*CELL).text.replace("island-1\n", "island-1\n    limits: lax\n")
    without = [one for one in CELL if one.name not in {"island-1", "island-2"}]
    now = project(*without, *(FoundStation(name, ("its file was not found",)) for name in ("Island 1", "island-2")))
    merged = merge(text, now)
    assert [group.name for group in readable(merged.text).devices] == ["island-1", "island-2"]
    assert "island-1: kept; the project has it, but it cannot be made now: its file was not found" in merged.sentences
    again = update(merged.text, update(project(*CELL).text, project(*CELL).text, now).text, project(*CELL))
    assert again.text == text


def test_a_station_renamed_in_the_project_has_its_new_name_and_is_found_by_its_address():
    text = project(*CELL).text.replace("axis-2\n", "axis-2\n    limits: lax\n") + "controller: {name: axis-2-plc}\n"
    renamed = drive("conveyor", 12)
    merged = merge(text, changed(renamed, without=("axis-2",)))
    assert merged.text.replace("conveyor", "axis-2") == text
    assert "axis-2: changed: name; its name is conveyor now" in merged.sentences


def test_a_station_that_the_user_renamed_or_removed_stays_so():
    text = project(*CELL).text.replace("name: axis-2\n", "name: feeder\n")
    merged = merge(text, changed(drive("axis-2", 12, 111)))
    assert "  - name: feeder\n    model: hiwin-e1\n    ip: 10.7.0.12/24\n    telegram: 111\n" in merged.text
    assert merged.sentences == ["feeder: changed: telegram"]
    begin = text.index("  - name: feeder")
    text = text[:begin] + text[text.index("devices:") :]
    merged = merge(text, changed(drive("axis-2", 22)))
    assert merged.text == text
    assert merged.sentences == ["axis-2: you removed it, and it is not added again"]


def test_a_user_s_own_station_with_the_name_or_address_of_a_new_one_is_kept():
    own = "  - {name: valve, model: akd-profinet, ip: 10.7.0.13/24}\ndevices:"
    text = project(*CELL).text.replace("devices:", own)
    for new in (drive("valve", 33), drive("axis-3", 13)):
        merged = merge(text, changed(new))
        assert merged.text == text
        assert "your own valve" in said(merged)


def test_a_group_that_stands_for_stations_is_to_be_changed_by_hand():
    text = project(*CELL).text
    at = text.index("  - name: axis-1")
    group = "  - name: axis-{n}\n    count: 2\n    model: hiwin-e1\n    ip: 10.7.0.11/24\n"
    text = text[:at] + group + text[text.index("devices:") :]
    assert merge(text, changed()).text == text
    line = text[:at].count("\n") + 1
    merged = merge(text, changed(drive("axis-2", 22)))
    assert merged.text == text
    assert f"axis-2: line {line}: ip of the project is '10.7.0.22/24' now: change it by hand" in said(merged)
    merged = merge(text, changed(without=("axis-2",)))
    assert merged.text == text
    assert f"axis-2: line {line}: the project has it no more: change it by hand" in said(merged)


def test_values_in_flow_style_change_in_place():
    text = project(*CELL).text
    begin, end = text.index("  - name: axis-1"), text.index("devices:")
    flow = "  - {name: axis-1, telegram: 111,  model: hiwin-e1, ip: 10.7.0.11/24}   # one\n"
    flow += "  - { model: hiwin-e1, name: axis-2, ip: '10.7.0.12/24' }\n"
    text = text[:begin] + flow + text[end:]
    merged = merge(text, changed(drive("axis-1", 11), drive("axis-2", 22, 111)))
    assert "  - {name: axis-1,  model: hiwin-e1, ip: 10.7.0.11/24}   # one\n" in merged.text
    assert "  - { model: hiwin-e1, name: axis-2, ip: 10.7.0.22/24, telegram: 111 }\n" in merged.text
    gone = merge(text, changed(without=("axis-1",)))
    assert "  # - {name: axis-1, telegram" in gone.text
    readable(gone.text)


def axes(*axes):
    listed = [{"name": name, "telegram": telegram} for name, telegram in axes]
    return FoundDrive("cu", "profidrive", {"ip": "10.7.0.21/24", "limits": "lax", "axes": listed})


@pytest.mark.parametrize("block", [False, True])
def test_axes_of_a_drive_change_one_by_one(block):
    base = axes(("x", 3), ("y", 3), ("z", 3))
    text = project(base).text
    line = next(one for one in text.split("\n") if "axes:" in one)
    lines = "    axes:\n    - name: x   # mine\n      telegram: 3\n    - {name: y, telegram: 3}\n"
    lines += "    # the last\n    - name: z\n      load: {inertia: 0.001}\n      telegram: 3"
    own = line.replace("{name: x", "{load: {inertia: 0.001}, name: x")
    text = text.replace(line, lines if block else own)
    merged = update(text, project(base).text, project(axes(("x", 5), ("y", 3), ("w", 3))))
    (group,) = readable(merged.text).drives
    assert {(one.name, one.telegram) for one in group.axes} >= {("x", 5), ("y", 3), ("w", 3)}
    assert len(group.axes) == (4 if block else 3), "the axis that is gone has a load of the user's"
    assert "load: {inertia: 0.001}" in merged.text
    assert ("# mine" in merged.text) == block


def test_a_signal_that_is_gone_is_kept_with_what_the_user_added_to_it():
    text = project(*CELL).text.replace("{at: 3.1.2, type: int16}", "{at: 3.1.2, type: int16, unit: bar}", 1)
    signals = {name: value for name, value in SIGNALS.items() if name not in {"pressure", "flow"}}
    merged = merge(text, changed(device("island-1", 41, SLOTS, signals)))
    assert set(readable(merged.text).devices[0].signals) == {*signals, "pressure"}
    assert "signals.pressure '{at: 3.1.2, type: int16, unit: bar}' is kept; the project has it no more" in said(merged)


def test_what_cannot_be_changed_safely_is_left_and_named_with_its_line():
    text = project(*CELL).text
    text = text.replace("ip: 10.7.0.11/24", "ip: &first 10.7.0.11/24").replace(
        "  - name: axis-2\n", "  - name: axis-2\n    behaviour: {}\n"
    )
    line = text[: text.index("&first")].count("\n") + 1
    merged = merge(text, changed(drive("axis-1", 21, 111), drive("axis-2", 22)))
    assert readable(merged.text).drives[0].ip == readable(text).drives[0].ip
    assert "ip: &first 10.7.0.11/24" in merged.text
    assert "ip: 10.7.0.22/24" in merged.text
    assert f"axis-1: line {line}: ip: the project has '10.7.0.21/24' now: change it by hand" in said(merged)


def test_windows_line_ends_stay():
    def windows(text):
        return text.replace("\n", "\r\n")

    text = windows(project(*CELL).text.replace("axis-2\n", "axis-2\n    limits: lax\n"))
    now = changed(drive("axis-2", 22, 111), drive("axis-3", 13), device("island-1", 41, SLOTS))
    now = Project(windows(now.text), now.source, now.addresses, now.unplayed)
    merged = update(text, windows(project(*CELL).text), now)
    assert merged.text == windows(merged.text.replace("\r", ""))
    assert [group.name for group in readable(merged.text).drives] == ["axis-1", "axis-2", "axis-3"]


def test_without_a_record_the_import_s_keys_are_the_project_s():
    text = project(*CELL).text.replace("ip: 10.7.0.11/24", "ip: 10.7.0.99/24   # mine\n    load: {inertia: 0.001}")
    text = text.replace("parent: eth1", "parent: eth7").replace("      lamp:", "      mine: 1.1.0.7\n      lamp:", 1)
    text = text.replace("devices:", "  - {name: own, model: akd-profinet}\ndevices:")
    merged = update(text, None, changed(drive("axis-3", 13)))
    assert "    ip: 10.7.0.11/24   # mine\n    load: {inertia: 0.001}" in merged.text
    config = readable(merged.text)
    assert [group.name for group in config.drives] == ["axis-1", "axis-2", "axis-3", "own"]
    assert "mine" in config.devices[0].signals
    assert "parent: eth7" in merged.text
    assert "own: kept; the project has no such station" in merged.sentences


# -- any edits, any project -----------------------------------------------------------------------------------------

NAMES = ["axis-1", "axis-2", "axis-3", "feeder"]
DRIVES = st.lists(
    st.builds(drive, st.sampled_from(NAMES), st.integers(11, 16), st.sampled_from([None, 111])),
    min_size=1, max_size=4, unique_by=(lambda one: one.name, lambda one: one.keys["ip"]),
)  # fmt: skip
PLACES = ["1.1.0.3", "1.1.0.4", {"at": "1.1.0", "type": "uint16"}, {"at": "3.1.2", "type": "int16"}]
DEVICES = st.lists(
    st.builds(
        lambda name, ip, more, signals: device(name, ip, SLOTS | more, signals),
        st.sampled_from(["island-1", "island-2", "valve"]),
        st.integers(41, 46),
        st.dictionaries(st.integers(4, 6), st.sampled_from(["DI16", "AI4"]), max_size=3),
        st.dictionaries(st.sampled_from(["a_quite_long_name", "b", "c", "d", "e"]), st.sampled_from(PLACES)),
    ),
    max_size=3, unique_by=(lambda one: one.name, lambda one: one.keys["ip"]),
)  # fmt: skip
PROJECTS = st.tuples(DRIVES, DEVICES).map(lambda found: (*found[0], *found[1]))


def _line(text, place, edit: Callable[[str], str]):
    lines = text.split("\n")
    at = place % (len(lines) - 1)
    lines[at] = edit(lines[at])
    return "\n".join(lines)


def comment_above(place, text):
    return _line(text, place, lambda line: " " * (place % 9) + f"# mine {place}\n{line}")


def comment_behind(place, text):
    return _line(text, place, lambda line: f"{line}  # mine {place}" if line.strip() else line)


def blank_line(place, text):
    return _line(text, place, lambda line: f"\n{line}")


def _group(place, text, edit):
    begins = [found.start() for found in re.finditer(r"^  - name: ", text, re.MULTILINE)]
    if not begins:
        return text
    begin = begins[place % len(begins)]
    end = re.compile(r"^(?=  - |[^ #\n])", re.MULTILINE).search(text, text.index("\n", begin) + 1)
    stop = end.start() if end else len(text)
    return text[:begin] + edit(text[begin:stop]) + text[stop:]


def own_key(place, text):
    def edit(group):
        head, _, rest = group.partition("\n")
        return group if "limits:" in group or "{" in head else f"{head}\n    limits: lax\n{rest}"

    return _group(place, text, edit)


def other_address(place, text):
    return _group(place, text, lambda group: re.sub(r"10\.7\.0\.\d+", f"10.7.1.{place % 200 + 1}", group))


def other_name(place, text):
    return _group(place, text, lambda group: re.sub(r"- name: [^ \n]+", f"- name: own-{place}", group, count=1))


def fewer_stations(place, text):
    return _group(place, text, lambda group: "") if text.count("  - name: ") > 2 else text


def own_top_level_key(place, text):
    return text if "lldp:" in text else text + "lldp: false\n"


def own_station(place, text):
    own = f"drives:\n  - {{name: mine-{place}, model: akd-profinet, ip: 10.7.2.{place % 200 + 1}/24}}\n"
    return text if f"mine-{place}," in text else text.replace("drives:\n", own, 1)


def quotes(place, text):
    return _group(place, text, lambda group: re.sub(r"ip: (10[^ \n]+)", r'"ip": "\1"', group))


def own_signal(place, text):
    def edit(group):
        return re.sub(r"(\n    signals:\n| {6}b: [^\n]+\n)", rf"\1      mine_{place}: 1.1.0.5\n", group, count=1)

    return text if f"mine_{place}:" in text else _group(place, text, edit)


def braces(place, text):
    def edit(group):
        (plain,) = parse_yaml(group).root.plain()
        return f"  - {json.dumps(plain)}\n"

    return _group(place, text, edit)


EDITS = st.lists(
    st.tuples(
        st.sampled_from([
            comment_above, comment_behind, blank_line, own_key, other_address, other_name, fewer_stations,
            own_top_level_key, own_station, quotes, own_signal, braces,
        ]),
        st.integers(0, 150),
    ),
    max_size=6,
)  # fmt: skip


def edited(text, edits):
    for edit, place in edits:
        text = edit(place, text)
    return text


def stations(text):
    """All groups by name."""
    values = parse_yaml(text).root.plain()
    return {one["name"]: one for key in ("drives", "devices") for one in values.get(key) or ()}


@settings(max_examples=25, deadline=None)
@given(PROJECTS, EDITS)
def test_any_edits_survive_a_second_import_of_the_same_project_unchanged(found, edits):
    now = project(*found)
    text = edited(now.text, edits)
    assert update(text, now.text, now).text == text


@settings(max_examples=25, deadline=None)
@given(PROJECTS, PROJECTS)
def test_a_file_without_edits_becomes_what_a_first_import_writes(before, after):
    base, now = project(*before), project(*after)
    merged = update(base.text, base.text, now)
    readable(merged.text)
    assert stations(merged.text) == stations(now.text)
    assert update(merged.text, now.text, now).text == merged.text
    assert sorted(merged.text.split("\n")) == sorted(now.text.split("\n"))


@settings(max_examples=40, deadline=None)
@given(PROJECTS, PROJECTS, EDITS)
def test_whatever_both_changed_the_user_s_comments_and_keys_stay_and_the_values_are_read(before, after, edits):
    base, now = project(*before), project(*after)
    text = edited(base.text, edits)
    merged = update(text, base.text, now)
    for mark in re.findall(r"# mine \d+", text):
        assert merged.text.count(mark) >= text.count(mark)
    for own in re.findall(r"10\.7\.[12]\.\d+|limits: lax|own-\d+|mine.\d+|lldp: false", text):
        assert merged.text.count(own) >= text.count(own)
    was, own, new, found = (stations(one) for one in (base.text, text, now.text, merged.text))
    by_hand = {one.partition(": ")[0] for one in merged.sentences if "by hand" in one}
    for name in was.keys() & own.keys() & new.keys() & found.keys() - by_hand:
        for key in was[name].keys() & own[name].keys() & new[name].keys() - {"signals", "slots"}:
            expected = new if own[name][key] == was[name][key] else own
            assert found[name][key] == expected[name][key], (name, key)
    assert update(merged.text, now.text, now).text == merged.text


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 30), st.sampled_from([
        "", "{", "}", "[", "]", ": ", "\n", "\n  ", "- ", "&a ", "*a", "#", "|\n", "'", "!!str ", "<<: *a", "name",
        "{n}", "count: 9\n    ", "drives:", "\u2028", "\t", "? ",
    ])), min_size=1, max_size=5),
    st.booleans(),
)  # fmt: skip
# a mapping instead of a list
@example(changes=[(335, 30, ""), (552, 30, "")], both=False)
@example(changes=[(335, 30, ""), (552, 30, "")], both=True)
def test_whatever_the_texts_hold_they_are_merged_or_refused(changes, both):
    text = base = project(*CELL).text
    for place, length, piece in changes:
        text = text[:place] + piece + text[place + length :]
    now = changed(drive("axis-1", 21), device("island-1", 41, {1: "AI4"}), drive("axis-3", 13), without=("axis-2",))
    with contextlib.suppress(YamlError, ConfigError):
        merged = update(text, text if both else base, now)
        parse_yaml(merged.text)
