"""The diagnosis of a device: the event of each change, and what is read."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.diagnosis import (
    DiagnosisAppeared,
    DiagnosisDisappeared,
    DiagnosisEntry,
    DiagnosisStore,
    Severity,
    diagnosis_blocks,
)
from pnfarm.protocols.profinet.wire.records.diagnosis import ChannelSpecifier, Direction, Maintenance, UserItem

PLACE = (0x3A00, 1, 1)
HOT = DiagnosisEntry(*PLACE, error_type=5)
SHORT = DiagnosisEntry(*PLACE, error_type=1)
WORN = DiagnosisEntry(*PLACE, error_type=0x9007, maintenance=Maintenance.REQUIRED)
OWN = DiagnosisEntry(*PLACE, usi=0x0021, data=b"\x01\x02")
QUALIFIED = DiagnosisEntry(
    *PLACE, usi=0x8003, error_type=5, maintenance=Maintenance.QUALIFIED, qualifier=1 << 3 | 1 << 17
)


@pytest.fixture
def store():
    return DiagnosisStore(maximum=6)


def told(store):
    return [(type(e).__name__[9:], e.entry, e.specifier, e.alarm_type) for e in store.events()]


def test_an_entry_appears_once_and_disappears_for_good(store):
    assert store.add(HOT)
    assert store.add(replace(HOT))
    assert told(store) == [("Appeared", HOT, ChannelSpecifier.APPEARS, 0x0001)]
    assert store.remove(HOT)
    assert not store.remove(HOT)
    assert told(store) == [("Disappeared", HOT, ChannelSpecifier.ALL_DISAPPEAR, 0x000C)]
    assert list(store) == []


def test_the_specifier_says_what_remains_on_the_channel(store):
    elsewhere = replace(HOT, channel=3)
    for entry in (HOT, SHORT, WORN, elsewhere, OWN):
        store.add(entry)
    store.events()
    for entry in (HOT, SHORT, WORN, elsewhere):
        store.remove(entry)
    assert [what[2] for what in told(store)] == [
        ChannelSpecifier.DISAPPEARS_OTHERS_REMAIN,  # another fault
        ChannelSpecifier.DISAPPEARS,  # only maintenance
        ChannelSpecifier.ALL_DISAPPEAR,
        ChannelSpecifier.ALL_DISAPPEAR,
    ]


def test_another_severity_appears_before_the_former_one_disappears(store):
    store.add(WORN)
    store.events()
    worse = replace(WORN, maintenance=Maintenance.DEMANDED)
    assert store.add(worse)
    assert told(store) == [
        ("Appeared", worse, ChannelSpecifier.APPEARS, 0x0001),
        ("Disappeared", WORN, ChannelSpecifier.DISAPPEARS_OTHERS_REMAIN, 0x000C),
    ]
    assert list(store) == [worse]


def test_new_data_of_the_manufacturers_say_that_the_old_ones_are_over(store):
    store.add(OWN)
    other = replace(OWN, data=b"new")
    store.add(other)
    store.remove(other)
    assert [(what[0], what[1].data, what[3]) for what in told(store)] == [
        ("Appeared", b"\x01\x02", 1),
        ("Appeared", b"new", 1),
        ("Disappeared", b"new", 12),
    ]


def test_network_errors_have_alarm_types_of_their_own_both_ways(store):
    remote = DiagnosisEntry(0, 0, 0x8001, usi=0x8002, error_type=0x8001, ext_error_type=0x8005)
    store.add(remote)
    store.remove(remote)
    assert [what[3] for what in told(store)] == [0x000E, 0x000E]


def test_a_full_store_refuses_and_counts_but_still_takes_changes(store):
    entries = [replace(HOT, channel=n) for n in range(7)]
    assert [store.add(e) for e in entries] == [True] * 6 + [False]
    assert store.refused == {"full": 1}
    assert store.add(replace(entries[0], maintenance=Maintenance.DEMANDED))
    assert len(store) == 6
    store.remove(entries[1])
    assert store.add(entries[6])


def test_clearing_a_submodule_gives_one_event_for_each_channel(store):
    beside = replace(HOT, subslot=2)
    for entry in (HOT, SHORT, replace(HOT, channel=7), OWN, beside):
        store.add(entry)
    store.events()
    assert store.clear(PLACE) == 4
    events = store.events()
    assert {(e.entry.channel, e.entry.usi) for e in events} == {(0x8000, 0x8000), (7, 0x8000), (0x8000, 0x0021)}
    assert {e.specifier for e in events} == {ChannelSpecifier.ALL_DISAPPEAR}
    assert [e.alarm_specifier for e in events] == [0, 0, 0]
    assert list(store) == [beside]
    assert store.clear() == 1


def test_power_off_forgets_without_a_word(store):
    store.add(HOT)
    store.forget()
    assert (len(store), store.events()) == (0, [])


def test_the_flags_of_an_alarm_are_those_of_the_captured_one(store):
    short = DiagnosisEntry(
        0, 1, 1, usi=0x8002, channel=4, direction=Direction.INPUT, error_type=1, channel_type=1
    )  # fmt: skip
    store.add(short)
    (event,) = store.events()
    assert event.emit_items() == [(0x8002, bytes.fromhex("0004 2801 0001 0000 00000000"))]
    assert event.alarm_specifier == 0x2800
    assert store.alarm_specifier(short.place, {short.place}) == 0xA800
    assert store.alarm_specifier(short.place, {(0, 2, 1)}) == 0x2800


def test_maintenance_is_no_fault_and_has_an_item_of_its_own(store):
    store.add(WORN)
    (event,) = store.events()
    assert event.alarm_specifier == 0x0800
    assert event.emit_items() == [
        (0x8100, bytes.fromhex("0f00 0008 0100 0000 00000001")),
        (0x8000, bytes.fromhex("8000 0a00 9007")),
    ]
    store.add(OWN)
    (event,) = store.events()
    assert event.alarm_specifier == 0x3800
    assert event.items() == (UserItem(0x21, b"\x01\x02"),)
    assert not store.has_fault({(0, 0, 1)})
    assert store.has_fault({PLACE})


def test_a_qualifier_says_several_severities(store):
    assert QUALIFIED.severities == {Severity.ADVICE, Severity.MAINTENANCE_DEMANDED}
    store.add(QUALIFIED)
    (event,) = store.events()
    assert event.maintenance_status == 0x0002_000A
    assert store.submodule_diag_state(PLACE) == 1 << 3 | 1 << 5


def test_the_state_of_a_submodule_for_the_module_difference(store):
    assert store.submodule_diag_state(PLACE) == 0
    for entry in (HOT, WORN):
        store.add(entry)
    assert store.submodule_diag_state(PLACE) == 1 << 4 | 1 << 6
    assert store.submodule_diag_state((0, 1, 1)) == 0


@pytest.mark.parametrize(
    "fields",
    [
        {"usi": 0x8000},
        {"usi": 0x8001, "error_type": 1},
        {"usi": 0x8100, "error_type": 1},
        {"usi": 0x8000, "error_type": 1, "data": b"x"},
        {"usi": 0x8000, "error_type": 1, "ext_error_type": 1},
        {"usi": 0x0001, "error_type": 1},
        {"usi": 0x0001, "maintenance": Maintenance.REQUIRED},
        {"usi": 0x8000, "error_type": 1, "channel": 0x8001},
        {"usi": 0x8003, "error_type": 1},
        {"usi": 0x8003, "error_type": 1, "maintenance": Maintenance.QUALIFIED},
        {"usi": 0x8003, "error_type": 1, "maintenance": Maintenance.QUALIFIED, "qualifier": 1},
        {"usi": 0x8000, "error_type": 1, "maintenance": Maintenance.QUALIFIED},
    ],
)
def test_entries_that_no_alarm_could_carry_are_refused(fields):
    with pytest.raises(ValueError):
        DiagnosisEntry(*PLACE, **fields)


# The three layouts of the MSD's manual, table 9.22; there BlockVersion is 0x0001.
MANUAL = {
    "standard": (
        DiagnosisEntry(*PLACE, direction=Direction.INPUT_OUTPUT, error_type=0x900F),
        "0010 0016 0001 0000 3a00 0001 0001 8000 0800 8000 8000 6800 900f",
    ),
    "expanded": (
        DiagnosisEntry(
            *PLACE, usi=0x8002, direction=Direction.INPUT_OUTPUT, error_type=0x900F, ext_add_value=0x0001000B
        ),
        "0010 001c 0001 0000 3a00 0001 0001 8000 0800 8002 8000 6800 900f 0000 0001 000b",
    ),
    "manufacturer": (
        DiagnosisEntry(
            0x3A00, 1, 2, usi=0x0001, direction=Direction.INPUT_OUTPUT, data=bytes.fromhex("0001000b00000000")
        ),
        "0010 0018 0001 0000 3a00 0001 0002 8000 6800 0001 0001 000b 0000 0000",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("name", "length"), [("standard", 26), ("expanded", 32), ("manufacturer", 28)])
def test_the_layouts_of_a_drives_manual_come_out_octet_for_octet(name, length):
    entry, text = MANUAL[name]
    (block,) = diagnosis_blocks([entry], version=0x0001)
    octets = block.emit()
    assert octets.hex(" ", 2) == text
    assert len(octets) == length


def test_blocks_join_what_has_one_place_and_one_coding():
    blocks = diagnosis_blocks([HOT, SHORT, QUALIFIED, OWN, replace(OWN, channel=1), replace(HOT, subslot=2)])
    assert [(b.subslot, b.usi, b.channel, len(b.items)) for b in blocks] == [
        (1, 0x8000, 0x8000, 2),
        (1, 0x8003, 0x8000, 1),
        (1, 0x0021, 0x8000, 1),
        (1, 0x0021, 1, 1),
        (2, 0x8000, 0x8000, 1),
    ]


entries = st.builds(
    lambda sub, channel, error, maintenance: DiagnosisEntry(
        0x3A00, 1, sub, channel=channel, error_type=error, maintenance=maintenance
    ),
    st.integers(1, 2), st.integers(0, 1), st.integers(1, 3), st.sampled_from(list(Maintenance)[:3]),
)  # fmt: skip


@settings(max_examples=200)
@given(st.lists(st.tuples(st.booleans(), entries), max_size=25))
def test_a_controller_that_follows_the_alarms_knows_what_is_wrong(steps):
    """It keeps what appeared and drops what the specifiers say; in the end it holds what the store holds."""
    store, known = DiagnosisStore(maximum=8), set()
    for add, entry in steps:
        (store.add if add else store.remove)(entry)
        for event in store.events():
            if event.specifier == ChannelSpecifier.APPEARS:
                assert isinstance(event, DiagnosisAppeared)
                known.add(event.entry)
            else:
                assert isinstance(event, DiagnosisDisappeared)
                gone = event.entry
                if event.specifier == ChannelSpecifier.ALL_DISAPPEAR:
                    known = {e for e in known if e.at != gone.at}
                else:
                    known.discard(gone)
    assert known == set(store)
