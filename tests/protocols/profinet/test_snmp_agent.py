"""The SNMP agent in memory: each request, each error with its index, both versions, answers that do not fit."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from snmp_support import VIEW, Manager

from pnfarm.protocols.profinet.snmp.agent import SystemTextSet
from pnfarm.protocols.profinet.snmp.mib import Mib, Scalar
from pnfarm.protocols.profinet.snmp.view import SystemText
from pnfarm.protocols.profinet.wire.snmp.message import (
    COUNTER64,
    END_OF_MIB_VIEW,
    GET,
    GET_BULK,
    GET_NEXT,
    NO_SUCH_INSTANCE,
    NO_SUCH_OBJECT,
    NULL_VALUE,
    RESPONSE,
    SET,
    VERSION_1,
    VERSION_2C,
    ErrorStatus,
    OtherPdu,
    Pdu,
    SnmpMessage,
    Value,
    VarBind,
    counter64,
    emit_snmp,
    integer,
    octets,
)

MIB_2 = (1, 3, 6, 1, 2, 1)
SYSTEM = (*MIB_2, 1)
DESCRIPTION, _, UPTIME, CONTACT, NAME, LOCATION, SERVICES = ((*SYSTEM, arc, 0) for arc in range(1, 8))
IF_TYPE_1 = (*MIB_2, 2, 2, 1, 3, 1)
HC_IN_OCTETS_1 = (*MIB_2, 31, 1, 1, 1, 6, 1)
#: One behind the other: a Counter32, the first Counter64, and what version 1 says instead.
OUT_BROADCAST_3 = (*MIB_2, 31, 1, 1, 1, 5, 3)
TRAP_ENABLE_1 = (*MIB_2, 31, 1, 1, 1, 14, 1)
SNMP = (*MIB_2, 11)
BEHIND_ALL = (2, 39)


@pytest.fixture
def manager():
    return Manager()


def outcome(pdu):
    return ErrorStatus(pdu.error_status), pdu.error_index


def both(test):
    return pytest.mark.parametrize("version", [VERSION_1, VERSION_2C])(test)


# -- reading -----------------------------------------------------------------------------------------------------------


@both
def test_get_answers_each_variable_in_its_place(manager, version):
    pdu = manager.get(SERVICES, CONTACT, SERVICES, version=version)
    assert outcome(pdu) == (ErrorStatus.NO_ERROR, 0)
    assert pdu.varbinds == (
        VarBind(SERVICES, integer(78)),
        VarBind(CONTACT, octets(b"me")),
        VarBind(SERVICES, integer(78)),
    )


@both
def test_a_request_without_variables_is_answered_without(manager, version):
    for tag in (GET, GET_NEXT, SET):
        assert manager.ask(tag, version=version, community=b"private").varbinds == ()


def test_version_2_distinguishes_a_missing_object_from_a_missing_instance(manager):
    pdu = manager.get(SERVICES, (*SYSTEM, 99, 0), (*SERVICES[:-1], 5), SERVICES[:-1], (*MIB_2, 2, 2, 1, 3, 77), (1, 0))
    assert outcome(pdu) == (ErrorStatus.NO_ERROR, 0)
    assert [varbind.value.tag for varbind in pdu.varbinds[1:]] == [
        NO_SUCH_OBJECT, NO_SUCH_INSTANCE, NO_SUCH_INSTANCE, NO_SUCH_INSTANCE, NO_SUCH_OBJECT,
    ]  # fmt: skip


def test_an_object_of_an_empty_table_is_known_without_an_instance():
    manager = Manager(replace(VIEW, lldp=replace(VIEW.lldp, neighbours=())))
    remote_name = (1, 0, 8802, 1, 1, 2, 1, 4, 1, 1, 9)
    (varbind,) = manager.get((*remote_name, 0, 1, 1)).varbinds
    assert varbind.value.tag == NO_SUCH_INSTANCE


@pytest.mark.parametrize("missing", [(*SYSTEM, 99, 0), (*SERVICES[:-1], 5), HC_IN_OCTETS_1])
def test_version_1_refuses_the_whole_request_and_names_the_variable(manager, missing):
    pdu = manager.get(SERVICES, UPTIME, missing, version=VERSION_1)
    assert outcome(pdu) == (ErrorStatus.NO_SUCH_NAME, 3)
    assert pdu.varbinds == tuple(VarBind(name, NULL_VALUE) for name in (SERVICES, UPTIME, missing))
    assert manager.agent.statistics[21] == 1  # snmpOutNoSuchNames


def test_version_2_reads_the_counter_of_64_bits_that_version_1_has_not(manager):
    (varbind,) = manager.get(HC_IN_OCTETS_1).varbinds
    assert varbind.value == counter64(2**32 - 5)


def test_get_next_of_version_1_steps_over_counters_of_64_bits(manager):
    assert manager.next(OUT_BROADCAST_3).varbinds[0].value.tag == COUNTER64
    (varbind,) = manager.next(OUT_BROADCAST_3, version=VERSION_1).varbinds
    assert varbind.name == TRAP_ENABLE_1


def test_the_end_is_an_exception_in_version_2_and_an_error_in_version_1(manager):
    pdu = manager.next(SERVICES, BEHIND_ALL)
    assert outcome(pdu) == (ErrorStatus.NO_ERROR, 0)
    assert pdu.varbinds[1] == VarBind(BEHIND_ALL, Value(END_OF_MIB_VIEW))
    assert outcome(manager.next(SERVICES, BEHIND_ALL, version=VERSION_1)) == (ErrorStatus.NO_SUCH_NAME, 2)


def test_one_request_is_one_view_at_its_time(manager):
    manager.bulk(SYSTEM, repetitions=50)
    assert manager.views == 1
    assert manager.seen_at == manager.now
    manager.set((CONTACT, octets(b"x")))
    assert manager.views == 1


def test_the_names_are_sorted_again_only_when_a_row_comes_or_goes(manager):
    agent = manager.agent
    manager.walk(repetitions=10)
    manager.view = replace(VIEW, system=replace(VIEW.system, contact="you", uptime_ns=5 * 10**9))
    assert manager.get(CONTACT, UPTIME).varbinds[0].value == octets(b"you")
    assert agent.mib.layouts == 1
    manager.view = replace(VIEW, interfaces=VIEW.interfaces[:1])
    assert manager.get((*MIB_2, 2, 1, 0), (*MIB_2, 2, 2, 1, 3, 2)).varbinds[1].value.tag == NO_SUCH_INSTANCE
    assert agent.mib.layouts == 2


# -- walks -------------------------------------------------------------------------------------------------------------


def test_every_walk_lists_the_whole_tree_in_order(manager):
    walked = manager.walk()
    names = [varbind.name for varbind in walked]
    assert names == sorted(set(names))
    assert len(names) > 250
    for repetitions in (1, 7, 50, 2**31 - 1):
        assert [v.name for v in manager.walk(repetitions=repetitions)] == names
    old = manager.walk(version=VERSION_1)
    assert [v.name for v in old] == [v.name for v in walked if v.value.tag != COUNTER64]


arcs = st.integers(0, 4) | st.sampled_from([127, 128, 2**32 - 1])
object_names = st.lists(arcs, max_size=4).map(lambda rest: (1, 3, *rest))


def constant(value):
    return lambda _: value


@given(
    st.sets(object_names, max_size=40),
    st.sets(object_names, max_size=5),
    st.integers(1, 20),
    st.sampled_from([300, 484, 1472]),
)
def test_a_walk_over_any_objects_ends_and_lists_them_sorted(names, wide, repetitions, size):
    manager = Manager(maximum_size=size)
    scalars = [Scalar(name, constant(counter64(5) if name in wide else octets(b"x" * 90))) for name in names]
    manager.agent.mib = Mib(lambda _: VIEW, scalars, [])
    expected = sorted((*name, 0) for name in names)
    assert [v.name for v in manager.walk()] == expected
    assert [v.name for v in manager.walk(repetitions=repetitions)] == expected
    narrow = sorted((*name, 0) for name in names - wide)
    assert [v.name for v in manager.walk(version=VERSION_1)] == narrow


@given(st.sets(object_names, min_size=1, max_size=40), object_names)
def test_get_next_finds_the_least_name_above_any_other(names, probe):
    manager = Manager()
    manager.agent.mib = Mib(lambda _: VIEW, [Scalar(name, constant(integer(1))) for name in names], [])
    above = sorted((*name, 0) for name in names if (*name, 0) > probe)
    (varbind,) = manager.next(probe).varbinds
    assert varbind == (VarBind(above[0], integer(1)) if above else VarBind(probe, Value(END_OF_MIB_VIEW)))


# -- GetBulk -----------------------------------------------------------------------------------------------------------

ALL = [varbind.name for varbind in Manager().walk()]
bulk_names = st.lists(st.sampled_from([*ALL, (0, 0), SYSTEM, BEHIND_ALL]), max_size=6)


def bulk_without_limit(manager, names, single, repetitions):
    """RFC 3416, 4.2.3, with a GetNext for each variable."""
    single = min(max(single, 0), len(names))
    found = [manager.next(name).varbinds[0] for name in names[:single]]
    row = names[single:]
    for _ in range(max(repetitions, 0) if row else 0):
        bound = [manager.next(name).varbinds[0] for name in row]
        found += bound
        row = [varbind.name for varbind in bound]
        if all(varbind.value.tag == END_OF_MIB_VIEW for varbind in bound):
            break
    return found


@given(bulk_names, st.integers(-2, 7), st.integers(-2, 40), st.sampled_from([200, 484, 1472]))
def test_get_bulk_is_as_much_of_the_standards_answer_as_fits(names, single, repetitions, size):
    manager = Manager(maximum_size=size)
    wanted = bulk_without_limit(Manager(), names, single, repetitions)
    pdu = manager.bulk(*names, single=single, repetitions=repetitions)
    assert outcome(pdu) == (ErrorStatus.NO_ERROR, 0)
    assert manager.size <= size
    ours = [(v.name, v.value.tag) for v in pdu.varbinds]
    assert ours == [(v.name, v.value.tag) for v in wanted][: len(ours)]
    if len(ours) < len(wanted):
        # the next one would not have gone in, give or take the envelope's longest form
        message = SnmpMessage(VERSION_2C, b"public", replace(pdu, varbinds=(*pdu.varbinds, wanted[len(ours)])))
        assert len(emit_snmp(message)) > size - 30


def test_get_bulk_over_a_whole_tree_stops_at_its_end_and_at_the_frames(manager):
    pdu = manager.bulk((0, 0), repetitions=2**31 - 1)
    assert 60 < len(pdu.varbinds) < 150
    assert 1400 < manager.size <= 1472
    pdu = manager.bulk(ALL[-2], repetitions=2**31 - 1)
    assert [v.value.tag == END_OF_MIB_VIEW for v in pdu.varbinds] == [False, True]


# -- answers that do not fit -------------------------------------------------------------------------------------------


def test_an_answer_that_does_not_fit_is_too_big_in_each_versions_form():
    view = replace(VIEW, system=replace(VIEW.system, description="d" * 255))
    manager = Manager(view, maximum_size=484)
    names = (DESCRIPTION, DESCRIPTION)
    pdu = manager.get(*names)
    assert (outcome(pdu), pdu.varbinds) == ((ErrorStatus.TOO_BIG, 0), ())
    pdu = manager.get(*names, version=VERSION_1)
    assert (outcome(pdu), len(pdu.varbinds)) == ((ErrorStatus.TOO_BIG, 0), 2)
    assert manager.agent.statistics[20] == 2  # snmpOutTooBigs
    assert outcome(manager.get(DESCRIPTION)) == (ErrorStatus.NO_ERROR, 0)


def test_where_not_even_the_error_fits_nothing_is_answered():
    # the error's index takes an octet more than the request's, and the variables go back as they came
    varbinds = (*[VarBind(SERVICES, octets(b"abc"))] * 128, VarBind((1, 3, 6), octets(b"abc")))
    request = emit_snmp(SnmpMessage(VERSION_1, b"public", Pdu(GET, 1, varbinds=varbinds)))
    roomy, tight = Manager(maximum_size=len(request) + 1), Manager(maximum_size=len(request))
    assert len(roomy.send(request)) == 1
    assert tight.send(request) == []
    assert tight.agent.dropped == {"silent": 1}
    assert tight.agent.statistics[31] == 1  # snmpSilentDrops


def test_a_message_longer_than_a_frame_is_not_looked_at(manager):
    huge = emit_snmp(SnmpMessage(VERSION_2C, b"public", Pdu(GET, 1, varbinds=(VarBind(SERVICES),) * 200)))
    assert manager.send(huge) == []
    assert manager.agent.dropped == {"too-long": 1}


# -- writing -----------------------------------------------------------------------------------------------------------


@both
def test_the_three_texts_can_be_set_together(manager, version):
    pairs = ((CONTACT, octets(b"hall 5")), (NAME, octets(b"")), (LOCATION, octets(b"l" * 255)))
    pdu = manager.set(*pairs, version=version)
    assert outcome(pdu) == (ErrorStatus.NO_ERROR, 0)
    assert pdu.varbinds == tuple(VarBind(*pair) for pair in pairs)
    assert manager.agent.events() == [
        SystemTextSet(SystemText.CONTACT, "hall 5"),
        SystemTextSet(SystemText.NAME, ""),
        SystemTextSet(SystemText.LOCATION, "l" * 255),
    ]
    assert manager.agent.events() == []


WRONG = [
    (CONTACT, integer(5), ErrorStatus.WRONG_TYPE, ErrorStatus.BAD_VALUE),
    (CONTACT, NULL_VALUE, ErrorStatus.WRONG_TYPE, ErrorStatus.BAD_VALUE),
    (LOCATION, octets(b"x" * 256), ErrorStatus.WRONG_LENGTH, ErrorStatus.BAD_VALUE),
    (NAME, octets("Größe".encode()), ErrorStatus.WRONG_VALUE, ErrorStatus.BAD_VALUE),
    (CONTACT[:-1], octets(b"x"), ErrorStatus.NO_CREATION, ErrorStatus.NO_SUCH_NAME),
    ((*CONTACT[:-1], 1), octets(b"x"), ErrorStatus.NO_CREATION, ErrorStatus.NO_SUCH_NAME),
    (DESCRIPTION, octets(b"x"), ErrorStatus.NOT_WRITABLE, ErrorStatus.NO_SUCH_NAME),
    (IF_TYPE_1, integer(6), ErrorStatus.NOT_WRITABLE, ErrorStatus.NO_SUCH_NAME),
    (BEHIND_ALL, integer(6), ErrorStatus.NOT_WRITABLE, ErrorStatus.NO_SUCH_NAME),
]


@pytest.mark.parametrize(("name", "value", "new", "old"), WRONG)
def test_one_bad_variable_leaves_all_as_they_were(manager, name, value, new, old):
    good = (CONTACT, octets(b"somebody"))
    for version, error, counter in ((VERSION_2C, new, None), (VERSION_1, old, 22 if old == 3 else 21)):
        pdu = manager.set(good, (name, value), good, version=version)
        assert outcome(pdu) == (error, 2)
        assert [v.name for v in pdu.varbinds] == [CONTACT, name, CONTACT]
        assert manager.agent.events() == []
        if counter is not None:
            assert manager.agent.statistics[counter] == 1


def test_a_read_only_community_sets_nothing(manager):
    wanted = ((CONTACT, octets(b"x")), (NAME, octets(b"y")))
    assert outcome(manager.set(*wanted, community=b"public")) == (ErrorStatus.NO_ACCESS, 1)
    assert outcome(manager.set(*wanted, community=b"public", version=VERSION_1)) == (ErrorStatus.NO_SUCH_NAME, 1)
    assert manager.agent.events() == []
    assert manager.agent.statistics[5] == 2  # snmpInBadCommunityUses


# -- who is not answered -----------------------------------------------------------------------------------------------


def test_communities_are_the_owners_choice():
    manager = Manager(read_community=b"look", write_community=b"touch")
    assert manager.get(SERVICES, community=b"look").varbinds
    assert manager.get(SERVICES, community=b"touch").varbinds
    assert outcome(manager.set((CONTACT, octets(b"x")), community=b"touch")) == (ErrorStatus.NO_ERROR, 0)
    for community in (b"public", b"private", b"Look", b""):
        message = SnmpMessage(VERSION_2C, community, Pdu(GET, 1, varbinds=(VarBind(SERVICES),)))
        assert manager.send(emit_snmp(message)) == []
    assert manager.agent.dropped == {"bad-community": 4}
    assert manager.agent.statistics[4] == 4


@pytest.mark.parametrize(
    ("version", "pdu"),
    [
        (VERSION_2C, Pdu(RESPONSE, 1)),
        (VERSION_1, Pdu(GET_BULK, 1, 0, 10, (VarBind(SYSTEM),))),
        (VERSION_1, OtherPdu(0xA4, b"")),
        (VERSION_2C, OtherPdu(0xA6, b"")),
        (VERSION_2C, OtherPdu(0xA7, b"")),
        (VERSION_2C, OtherPdu(0xA8, b"")),
    ],
)
def test_what_no_manager_asks_is_dropped(manager, version, pdu):
    assert manager.send(emit_snmp(SnmpMessage(version, b"public", pdu))) == []
    assert manager.agent.dropped == {"unexpected-pdu": 1}


def test_octets_that_are_no_message_are_counted_by_their_reason(manager):
    for data in (b"", b"\x30", b"\x30\x03\x02\x01\x03", bytes(100)):
        assert manager.send(data) == []
    assert manager.agent.dropped == {"short": 2, "bad-version": 1, "bad-tag": 1}
    assert manager.agent.statistics[3] == 1  # snmpInBadVersions
    assert manager.agent.statistics[6] == 3  # snmpInASNParseErrs


def test_an_agent_has_no_deadline(manager):
    manager.get(SERVICES)
    assert manager.agent.next_deadline() is None
    manager.agent.handle_timeout(10**18)
    assert manager.agent.to_send(10**18) == []


def test_the_snmp_group_counts_what_happened(manager):
    manager.get(SERVICES, UPTIME)
    manager.next(SERVICES)
    manager.bulk(SYSTEM, repetitions=3)
    manager.set((CONTACT, octets(b"x")))
    manager.send(b"rubbish")
    names = {"in": 1, "out": 2, "parse": 6, "read": 13, "set": 14, "gets": 15, "nexts": 16, "sets": 17, "answers": 28}
    pdu = manager.get(*((*SNMP, arc, 0) for arc in names.values()))
    counted = dict(zip(names, (varbind.value.content for varbind in pdu.varbinds), strict=True))
    assert counted == {
        "in": 6, "out": 4, "parse": 1, "read": 6, "set": 1, "gets": 2, "nexts": 2, "sets": 1, "answers": 4,
    }  # fmt: skip


@given(st.binary(max_size=120))
def test_any_datagram_is_answered_by_one_at_most(data):
    manager = Manager()
    answers = manager.send(data)
    assert len(answers) <= 1
    assert all(len(answer.data) <= 1472 for answer in answers)


names_anywhere = st.sampled_from([*ALL, SYSTEM, (0, 0), BEHIND_ALL, (1, 3)])


@given(
    st.sampled_from([GET, GET_NEXT, SET, GET_BULK]),
    st.sampled_from([VERSION_1, VERSION_2C]),
    st.sampled_from([b"public", b"private"]),
    st.lists(st.builds(VarBind, names_anywhere, st.sampled_from([NULL_VALUE, octets(b"x"), integer(3)])), max_size=100),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
)
def test_every_request_that_fits_a_frame_is_answered_within_one(tag, version, community, varbinds, status, index):
    manager = Manager()
    request = emit_snmp(SnmpMessage(version, community, Pdu(tag, 1, status, index, tuple(varbinds))))
    answers = manager.send(request)
    if len(request) > 1472 or (tag == GET_BULK and version == VERSION_1):
        assert answers == []
    else:
        assert len(answers) == 1
        assert len(answers[0].data) <= 1472
