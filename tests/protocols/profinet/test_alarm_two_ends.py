"""Both ends of an alarm channel over a wire that loses, doubles, delays and reorders; and any PDUs at one end."""

from __future__ import annotations

from dataclasses import dataclass, field

from alarm_kit import CONTROLLER, DEVICE, STEP, alarm, controller_end, device_end, unfinished
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.alarms.channel import (
    AlarmAcknowledged,
    AlarmChannel,
    AlarmEvent,
    AlarmFailed,
    AlarmReceived,
    AlarmRefusedError,
    PeerAborted,
)
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, acknowledge
from pnfarm.protocols.profinet.wire.alarms.rta import RtaPdu, parse_rta

#: What the wire does to a frame: the delays of its copies, in nanoseconds; none for a lost one.
fates = st.lists(
    st.sampled_from(((), (), (0,), (0,), (0,), (0, 0), (STEP // 3,), (0, STEP * 3 // 2), (STEP * 5 // 4, STEP // 7))),
    max_size=80,
)
mild_fates = st.lists(st.sampled_from(((), (0,), (0,), (0, 0), (STEP // 3,), (STEP // 5, 0))), max_size=80)


@dataclass
class Wire:
    fates: list[tuple[int, ...]]
    device: AlarmChannel = field(default_factory=device_end)
    controller: AlarmChannel = field(default_factory=controller_end)
    now: int = 0
    passing: list[tuple[int, int, AlarmChannel, RtaPdu]] = field(default_factory=list)
    count: int = 0
    device_events: list[AlarmEvent] = field(default_factory=list)
    controller_events: list[AlarmEvent] = field(default_factory=list)

    def _carry(self, channel: AlarmChannel, peer: AlarmChannel) -> None:
        for _, octets in channel.to_send(self.now):
            pdu = parse_rta(octets)
            # an ERR gets through: what a lost one leaves behind is the cyclic watchdog's to find
            copies = (0,) if pdu.type == 4 or not self.fates else self.fates.pop(0)
            for delay in copies:
                self.count += 1
                self.passing.append((self.now + delay, self.count, peer, pdu))

    def _take(self, channel: AlarmChannel, events: list[AlarmEvent]) -> None:
        for event in channel.events():
            events.append(event)
            if isinstance(event, AlarmReceived):
                assert channel.acknowledge(event.alarm, self.now)
            elif isinstance(event, AlarmFailed):
                channel.abort(event.code)

    def settle(self) -> None:
        self._take(self.device, self.device_events)
        self._take(self.controller, self.controller_events)
        self._carry(self.device, self.controller)
        self._carry(self.controller, self.device)

    def run(self) -> None:
        """Until nothing is on its way and no timer runs; each step is the next thing in time."""
        for _ in range(20_000):
            self.settle()
            self.passing.sort(key=lambda entry: entry[:2])
            times = [entry[0] for entry in self.passing[:1]]
            times += [d for d in (self.device.next_deadline(), self.controller.next_deadline()) if d is not None]
            if not times:
                return
            self.now = max(self.now, min(times))
            if self.passing and self.passing[0][0] <= self.now:
                _, _, peer, pdu = self.passing.pop(0)
                peer.receive(pdu, self.now)
            else:
                self.device.handle_timeout(self.now)
                self.controller.handle_timeout(self.now)
        raise AssertionError("it never comes to rest")


def check(wire: Wire, wanted: list[AlarmNotification], sender: list[AlarmEvent], taker: list[AlarmEvent]) -> None:
    failed = any(isinstance(event, AlarmFailed | PeerAborted) for event in sender)
    assert not wire.device.dropped["peer-counts-once"]
    assert not wire.controller.dropped["peer-counts-once"]
    for high in (False, True):
        want = [a.subslot for a in wanted if a.high == high]
        got = [e.alarm.subslot for e in taker if isinstance(e, AlarmReceived) and e.alarm.high == high]
        done = [e.alarm.subslot for e in sender if isinstance(e, AlarmAcknowledged) and e.alarm.high == high]
        assert got == want[: len(got)], "in order, each once"
        assert done == want[: len(done)], "confirmed in order, each once"
        assert len(done) <= len(got), "none is confirmed that did not arrive"
        if not failed:
            assert got == done == want
    if failed:
        assert any(isinstance(event, AlarmFailed | PeerAborted) for event in taker)
        assert not wire.device.is_open
        assert not wire.controller.is_open


@settings(max_examples=400)
@given(fates, st.lists(st.booleans(), max_size=8), st.lists(st.booleans(), max_size=4))
def test_every_alarm_arrives_once_and_in_order_or_both_ends_report_failure(fates, raised, returned):
    wire = Wire(list(fates))
    there = [alarm(n, high=high) for n, high in enumerate(raised)]
    back = [alarm(0x100 + n, high=high) for n, high in enumerate(returned)]
    for item in there:
        wire.device.notify(item, 0)
    for item in back:
        wire.controller.notify(item, 0)
    wire.run()
    check(wire, there, wire.device_events, wire.controller_events)
    check(wire, back, wire.controller_events, wire.device_events)


@settings(max_examples=200)
@given(mild_fates, st.lists(st.booleans(), min_size=1, max_size=10))
def test_with_retries_enough_every_loss_is_made_good(fates, raised):
    wire = Wire(list(fates), device_end(rta_retries=100), controller_end(rta_retries=100))
    alarms = [alarm(n, high=high) for n, high in enumerate(raised)]
    for item in alarms:
        wire.device.notify(item, 0)
    wire.run()
    assert sum(isinstance(event, AlarmAcknowledged) for event in wire.device_events) == len(alarms)
    check(wire, alarms, wire.device_events, wire.controller_events)


bodies = st.one_of(
    st.just(b""),
    st.binary(max_size=40),
    st.sampled_from((alarm(1).emit(), acknowledge(alarm(1)).emit(), alarm(1, high=True).emit())),
    st.just(bytes(400)),
)
numbers = st.one_of(st.sampled_from((0xFFFE, 0xFFFF, 0, 1, 0x7FFF)), st.integers(0, 0xFFFF))
hostile = st.builds(
    RtaPdu,
    frame_id=st.sampled_from((0xFC01, 0xFE01)),
    destination=st.sampled_from((DEVICE, DEVICE, DEVICE, 7)),
    source=st.sampled_from((CONTROLLER, CONTROLLER, CONTROLLER, 7)),
    pdu_type=st.one_of(st.sampled_from((0x11, 0x12, 0x13, 0x14)), st.integers(0, 0xFF)),
    add_flags=st.sampled_from((0x11, 0x01, 0xFF)),
    send_sequence=numbers,
    ack_sequence=numbers,
    body=bodies,
)
deeds = st.one_of(hostile, st.sampled_from(("notify-low", "notify-high", "acknowledge", "time")))


@settings(max_examples=400)
@given(st.lists(deeds, max_size=60))
def test_no_sequence_of_pdus_breaks_a_channel_and_each_alarm_ends_once(sequence):
    device, now, taken, handles, ended = device_end(), 0, [], set(), []
    closed, refusals = 0, []
    for deed in sequence:
        if isinstance(deed, RtaPdu):
            device.receive(deed, now)
        elif deed == "time":
            now += STEP // 2
            device.handle_timeout(now)
        elif deed == "acknowledge":
            device.acknowledge(taken.pop() if taken else alarm(1), now)
        else:
            try:
                handles.add(device.notify(alarm(3, high=deed == "notify-high"), now))
            except AlarmRefusedError as exc:
                refusals.append((exc.reason, device.is_open, unfinished(device)[1]))
        for event in device.events():
            if isinstance(event, AlarmReceived):
                taken.append(event.alarm)
            elif isinstance(event, AlarmAcknowledged):
                ended.append(event.handle)
            else:
                closed += 1
        assert len(device.to_send(now)) <= 8
        deadline = device.next_deadline()
        assert deadline is None or now - STEP < deadline <= now + STEP
        assert unfinished(device)[0] <= 2
    assert all(
        not is_open if reason == "closed" else (reason, queued >= 32) == ("queue-full", True)
        for reason, is_open, queued in refusals
    )
    assert len(ended) == len(set(ended))
    assert set(ended) <= handles
    assert closed == (not device.is_open)
    if not device.is_open:
        assert device.next_deadline() is None
