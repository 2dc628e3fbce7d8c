"""What a station remembers of its controllers: bounded, and it ends with what ended it."""

from hypothesis import given
from hypothesis import strategies as st

from pnfarm.station.events import ConnectionEstablished, ConnectionLost, ConnectionReleased, PowerLost, StartUpPhase
from pnfarm.station.visits import MOST_CALLERS, MOST_REFUSALS, Caller, Refusal, Visits, VisitState

PLC = Caller("10.0.0.1", b"\x02\0\0\0\0\1", "plc")


def only(visits):
    (visit,) = visits
    return visit


def test_a_search_by_mac_and_a_connection_by_address_are_of_one_controller():
    visits = Visits()
    visits.step(Caller(mac=PLC.mac), "searched", 1)
    visits.opened(PLC, 1, 2_000_000, 6_000_000, 2)
    assert only(visits).caller == PLC
    assert list(only(visits).steps) == ["searched", "connected"]


def test_controllers_behind_one_router_are_told_apart_by_their_addresses():
    visits = Visits()
    visits.opened(PLC, 1, 0, 0, 1)
    visits.opened(PLC._replace(address="10.0.0.2", name="other"), 2, 0, 0, 2)
    assert [visit.caller.name for visit in visits] == ["plc", "other"]


def test_steps_hold_while_the_connection_stands():
    visits = Visits()
    visits.step(PLC, "addressed", 1)
    visits.opened(PLC, 7, 0, 0, 2)
    visits.take(StartUpPhase("parameters", 7), 3)
    visits.take(StartUpPhase("ready", 7), 4)
    assert only(visits).state is VisitState.STARTING
    visits.take(ConnectionEstablished(connection=7), 5)
    assert only(visits).steps == {"addressed": 1, "connected": 2, "parameters": 3, "ready": 4, "data": 5}
    assert only(visits).state is VisitState.DATA
    visits.take(ConnectionLost(connection=7), 6)
    assert (only(visits).state, only(visits).steps, only(visits).ended) == (VisitState.ENDED, {"addressed": 1}, "lost")
    visits.opened(PLC, 8, 0, 0, 7)
    visits.take(ConnectionReleased(connection=8), 8)
    assert only(visits).ended == "released"
    visits.take(PowerLost(), 9)
    assert list(visits) == []


def test_a_refusal_is_counted_and_goes_when_an_attempt_succeeds_or_fails_otherwise():
    visits = Visits()
    first, second = Refusal("size"), Refusal("path")
    for _ in range(3):
        visits.refused(PLC, [first], attempt=True)
    assert only(visits).refusals == [(first, 3)]
    assert only(visits).state is VisitState.REFUSED
    visits.refused(PLC, [second], attempt=True)
    assert only(visits).refusals == [(second, 1)]
    # what is refused behind it shows while it is tried anew
    visits.opened(PLC, 1, 0, 0, 5)
    assert only(visits).refusals == [(second, 1)]
    visits.take(ConnectionEstablished(connection=1), 6)
    assert only(visits).refusals == []


def test_a_connection_that_works_keeps_what_was_refused_in_it():
    visits = Visits()
    visits.opened(PLC, 1, 0, 0, 1)
    visits.refused(PLC, [Refusal("slot 3")], final=False)
    visits.take(ConnectionEstablished(connection=1), 2)
    assert [one.text for one, _ in only(visits).refusals] == ["slot 3"]


def test_those_with_a_connection_stay_when_many_others_search():
    visits = Visits()
    visits.opened(PLC, 1, 0, 0, 1)
    for n in range(100):
        visits.step(Caller(mac=n.to_bytes(6, "big")), "searched", n)
    assert len(list(visits)) == MOST_CALLERS
    assert visits.of_connection(1) is not None


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["step", "opened", "refused", "closed", "established", "power"]),
            st.integers(0, 40),
            st.integers(0, 200),
        ),
        max_size=200,
    )
)
def test_nothing_makes_it_grow_and_each_change_is_counted(inputs):
    visits = Visits()

    def seen():
        return [(visit.caller, dict(visit.steps), visit.state, visit.refusals, visit.left_out) for visit in visits]

    for kind, who, number in inputs:
        before, revision = seen(), visits.revision
        caller = Caller(f"10.0.0.{who}")
        match kind:
            case "step":
                visits.step(caller, "searched", number)
            case "opened":
                visits.opened(caller, number, 0, 0, number)
            case "refused":
                many = [Refusal(f"slot {n}") for n in range(number)]
                visits.refused(caller, many, attempt=bool(number & 1), final=bool(number & 2))
            case "closed":
                visits.closed(number, "lost")
            case "established":
                visits.take(ConnectionEstablished(connection=number), number)
            case "power":
                visits.take(PowerLost(), number)
        assert seen() == before or visits.revision > revision
        assert len(before) <= MOST_CALLERS
        assert all(len(visit.refusals) <= MOST_REFUSALS for visit in visits)
