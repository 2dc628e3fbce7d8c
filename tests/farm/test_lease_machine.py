"""The lease in virtual time: whatever is late, lost, frozen or drifts, never do two speak at a time."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.farm.lease import DEFAULT_TTL_NS, Lease, LeaseChanged, LeaseState, margin_ns, renewal_ns

TTL = DEFAULT_TTL_NS
MS = 1_000_000


class Database:
    """One farm's claims, by a clock of its own; what the statements of the real one do."""

    def __init__(self, offset: int) -> None:
        self.offset = offset
        self.claims: dict[str, tuple[str, int, int]] = {}
        self.periods = 0

    def claim(self, holder: str, drives: tuple[str, ...], now: int) -> str | None:
        """The period if every drive is its own now, None if another has one."""
        clock = now + self.offset
        mine = [self.claims.get(drive) for drive in drives]
        if any(one is not None and one[0] != holder and one[1] > clock for one in mine):
            return None
        if any(one is None or one[0] != holder for one in mine):
            self.periods += 1
            periods = dict.fromkeys(drives, self.periods)
        else:
            periods = {drive: self.claims[drive][2] for drive in drives}
        for drive in drives:
            self.claims[drive] = (holder, clock + TTL, periods[drive])
        return str(sorted(set(periods.values())))


class Holder:
    """A process with a clock that starts anywhere and runs at its own rate."""

    def __init__(self, name: str, drives: tuple[str, ...], offset: int, rate: float) -> None:
        self.name, self.drives, self.offset, self.rate = name, drives, offset, rate
        self.lease = Lease(TTL)
        self.frozen_until = 0
        #: (time, what) of requests and answers on their way.
        self.under_way: list[tuple[int, str, int, str | None]] = []

    def clock(self, now: int) -> int:
        return self.offset + int(now * self.rate)


DRIVES = (("a", "b"), ("b", "c"), ("a", "b", "c"))
STEP = 50 * MS


def troubles(seed: int) -> list[tuple[int, str, int]]:
    """What goes wrong each second: whom, what, for how many milliseconds."""
    chance = random.Random(seed)
    kinds = ["freeze", "lose", "slow", "fast", "none"]
    return [(chance.randrange(3), chance.choice(kinds), chance.randrange(1, 12_000)) for _ in range(45)]


@settings(max_examples=150)
@given(
    st.integers(0, 2**32).map(troubles),
    st.lists(st.tuples(st.integers(0, 10**15), st.floats(0.95, 1.05)), min_size=3, max_size=3),
    st.integers(-(10**15), 10**15),
)
def test_never_do_two_speak_for_one_drive(events, clocks, offset):
    database = Database(offset)
    holders = [Holder(str(n), DRIVES[n], *clocks[n]) for n in range(3)]
    script = iter(events)
    lossy = dict.fromkeys(range(3), 0)
    slow = dict.fromkeys(range(3), 0)
    for step in range(900):
        now = step * STEP
        if step % 20 == 0 and (event := next(script, None)) is not None:
            who, what, milliseconds = event
            if what == "freeze":
                holders[who].frozen_until = now + milliseconds * MS
            elif what == "lose":
                lossy[who] = now + milliseconds * MS
            elif what == "slow":
                slow[who] = milliseconds * MS
            elif what == "fast":
                slow[who] = 0
        for number, holder in enumerate(holders):
            # what is under way goes on, also to the database of a frozen holder
            for message in sorted(holder.under_way):
                due, kind, sent, period = message
                if due > now:
                    continue
                if kind == "request":
                    holder.under_way.remove(message)
                    answer = database.claim(holder.name, holder.drives, now)
                    if now >= lossy[number]:
                        holder.under_way.append((now + slow[number] // 2, "answer", sent, answer))
                elif now >= holder.frozen_until:
                    holder.under_way.remove(message)
                    if period is None:
                        holder.lease.refused(holder.clock(now))
                    else:
                        holder.lease.granted(sent, period, holder.clock(now))
            if now < holder.frozen_until:
                continue
            clock = holder.clock(now)
            holder.lease.handle_timeout(clock)
            if holder.lease.next_request(clock) <= clock:
                sent = holder.lease.asked(clock)
                holder.under_way.append((now + slow[number] // 2, "request", sent, None))
        speaking: dict[str, str] = {}
        for holder in holders:
            # a frozen one is asked, too: it may be woken at this moment, with nothing read yet
            if holder.lease.may_speak(holder.clock(now)):
                for drive in holder.drives:
                    assert speaking.setdefault(drive, holder.name) == holder.name
    for holder in holders:
        assert all(change.state in LeaseState for change in holder.lease.changes())


def test_a_lone_holder_gets_it_renews_it_and_speaks_without_a_gap():
    lease = Lease(TTL)
    assert not lease.may_speak(0)
    for now in range(0, 20 * renewal_ns(TTL), renewal_ns(TTL)):
        assert lease.next_request(now) <= now
        lease.granted(lease.asked(now), "1", now + 100 * MS)
        assert lease.may_speak(now + renewal_ns(TTL))
    assert lease.changes() == [LeaseChanged(LeaseState.HELD, anew=True)]


def test_it_is_mute_a_margin_before_its_claims_end_counted_from_the_request():
    lease = Lease(TTL)
    lease.granted(lease.asked(1000), "1", 1000 + 2_000 * MS)
    assert lease.may_speak(1000 + TTL - margin_ns(TTL) - 1)
    assert not lease.may_speak(1000 + TTL - margin_ns(TTL))


def test_an_answer_that_comes_too_late_is_none():
    lease = Lease(TTL)
    lease.granted(lease.asked(0), "1", TTL)
    assert (lease.state, lease.may_speak(TTL)) == (LeaseState.WAITING, False)
    lease.granted(lease.asked(TTL), "1", TTL + 1)
    assert lease.may_speak(TTL + 1)


@pytest.mark.parametrize("taken", [False, True])
def test_after_a_loss_it_knows_whether_another_had_it(taken):
    lease = Lease(TTL)
    lease.granted(lease.asked(0), "1", 1)
    lease.handle_timeout(TTL)
    assert lease.state is LeaseState.LOST
    if taken:
        lease.refused(TTL)
        assert lease.state is LeaseState.WAITING
    lease.granted(lease.asked(2 * TTL), "2" if taken else "1", 2 * TTL + 1)
    assert lease.changes()[-1] == LeaseChanged(LeaseState.HELD, anew=taken)
