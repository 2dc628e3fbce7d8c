"""One tick of the engine: frames in, watchdogs, firmware, frames out.

The same functions serve the real-time loop and virtual time, drives and controllers.  A tick never waits,
never allocates and accesses nothing but the table.  A call that is not inlined copies the description of every array
that it is given, and all columns have many: what takes them in each tick is inlined.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import class1, framing
from pnfarm.engine.channels.consuming import accept, accept_rtc, check, check_rtc, zero
from pnfarm.engine.channels.delay_queue import copy_octets, forget, release_all, take_first
from pnfarm.engine.channels.impair import GOES_ON, HELD, IS_LOST, WAS_CHANGED, impair_received, impair_sent
from pnfarm.engine.channels.plain_data import spoil_pieces
from pnfarm.engine.channels.providing import pack, pack_rtc
from pnfarm.engine.columns import CHANGED_AT, Columns, lookup_find
from pnfarm.engine.conditions import watch_conditions
from pnfarm.engine.mac import mac_at
from pnfarm.engine.observe import fault_began, fault_ended, observe
from pnfarm.engine.plant.pace import plant_moment, step_plant
from pnfarm.engine.tracing import sample
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.drive_clock import drive_time
from pnfarm.firmware.front import has_parameter_channel, step_program, tells
from pnfarm.firmware.profidrive.sign_of_life import count_life
from pnfarm.firmware.step import step
from pnfarm.table.axis_codes import FAULT_SLOTS, NUMBER_MASK
from pnfarm.table.channel import (
    CLOSED,
    DISCARD_IMPAIRED,
    FRAME_SLOT,
    FRAMING_RTC,
    FRUN,
    IDLE,
    OPEN,
    RUN,
    W_START,
)
from pnfarm.table.compiling.by_address import by_address
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.delay_queue import INWARD, OUTWARD
from pnfarm.table.engine_row import (
    ACKNOWLEDGE_REFUSED,
    EXPIRED,
    FAULT_RAISED,
    FAULT_REACTED,
    FAULTS_CLEARED,
    PARAMETER_TASK,
    PHASE_CHANGED,
    STATE_CHANGED,
    WARNING_CHANGED,
    emit,
)
from pnfarm.table.image import IMAGE, LOST_CLOSED, LOST_EXPIRED, LOST_STOP

__all__ = [
    "first_due",
    "next_due",
    "next_step",
    "one_tick",
    "receive",
    "receive_at",
    "receive_from",
    "run_firmware",
    "tick",
    "transmit",
]

#: Between two ticks of a table whose rows send nothing and whose drives are not due earlier.
LONGEST_STEP_NS = 4_000_000

#: Its machine code is one for all loops that tick.
_step = by_address(step, AXIS, IMAGE)


@inlined
def _comes_through(columns: Columns, number: int, frame: Any, length: int, place: int, data: int, arrival: int) -> bool:
    """Whether a frame of a consumer with impairments goes on now."""
    engine = columns.engine[0]
    consumer = columns.cpm[number]
    outcome = impair_received(
        engine, columns.impairment, consumer, columns.held, columns.held_order, columns.frames, columns.ppm.shape[0],
        number, frame, length, place, data, arrival,
    )  # fmt: skip
    if outcome == IS_LOST:
        consumer.discarded[DISCARD_IMPAIRED] += 1
    if outcome >= HELD:
        # the gap that it leaves is not the controller's
        consumer.impaired += 1
    if outcome == WAS_CHANGED and _data_of(consumer, frame, length, place) == 0:
        engine.unknown += 1
        return False
    return bool(outcome < HELD)


@inlined
def _data_of(consumer: Any, frame: Any, length: int, place: int) -> int:
    """Where the data begin in a frame that was changed on its way; 0 where it is no longer one of this consumer."""
    if framing.locate(frame, length) != place or not framing.comes_from(consumer, frame):
        return 0
    if framing.identity(frame, place) != consumer.frame_id or mac_at(frame, 0) != consumer.destination:
        return 0
    return framing.fits(consumer, frame, length, place)


@inlined
def _stray(columns: Columns, port: int, frame: Any) -> None:
    """Count a frame that belongs to no channel for the station at whose port it came in.

    Frames for other stations, which a bridge floods, do not count.
    """
    images = columns.image
    for i in range(len(images)):
        if images[i].port == port:
            if frame[0] & 1 or mac_at(frame, 0) == images[i].mac:
                images[i].strays += 1
            return


@inlined
def _release_received(columns: Columns, until: int) -> None:
    """Take the held frames that are due up to ``until``."""
    engine = columns.engine[0]
    store = columns.ppm.shape[0]
    order = columns.held_order[INWARD]
    while engine.held_in > 0 and columns.held[order[0]].due_ns <= until:
        slot = take_first(columns.held, order, int(engine.held_in), columns.impairment)
        engine.held_in -= 1
        item = columns.held[slot]
        consumer = columns.cpm[item.row]
        if consumer.active == 0 or consumer.generation != item.generation:
            continue
        frame = columns.frames[store + slot]
        length = int(item.length)
        data = _data_of(consumer, frame, length, int(item.place))
        if data == 0:
            engine.unknown += 1
            continue
        accept(
            engine, columns.events, columns.image, columns.cpm, columns.consumed, columns.piece,
            int(item.row), consumer, frame, length, data, int(item.due_ns),
        )  # fmt: skip


@inlined
def _release_sent(
    engine: Any, held: Any, order: Any, impairments: Any, tx_row: Any, store: int, now: int, count: int
) -> int:
    """Send the held frames that are due, after the ``count`` frames in ``tx_row``; the new count."""
    while engine.held_out > 0 and count < tx_row.shape[0] and held[order[0]].due_ns <= now:
        slot = take_first(held, order, int(engine.held_out), impairments)
        engine.held_out -= 1
        engine.busy_out += 1
        if held[slot].row >= 0:
            tx_row[count] = store + slot
            count += 1
    return count


@inlined
def _release_ended(columns: Columns) -> None:
    """Let frames go on whose impairment has ended, before what came since the last tick."""
    engine = columns.engine[0]
    engine.ended_seen = engine.ended
    before = int(engine.now_ns)
    release_all(columns.held, columns.held_order[OUTWARD], int(engine.held_out), columns.impairment, before)
    release_all(columns.held, columns.held_order[INWARD], int(engine.held_in), columns.impairment, before)


@inlined
def receive_from(columns: Columns, octets: Any, places: Any, count: int) -> None:
    """Take ``count`` frames, which begin at ``places`` in ``octets``, or below 0 in the receive slots."""
    engine = columns.engine[0]
    if engine.ended != engine.ended_seen:
        _release_ended(columns)
    engine.received += count
    table = columns.lookup[engine.lookup]
    consumers = columns.cpm
    events = columns.events
    images = columns.image
    for i in range(count):
        if engine.held_in > 0:
            _release_received(columns, columns.rx_ns[i])
        if places[i] >= 0:
            frame = octets[places[i] : places[i] + FRAME_SLOT]
        else:
            frame = columns.rx_octets[-1 - places[i] : FRAME_SLOT - 1 - places[i]]
        length = int(columns.rx_length[i])
        place = framing.locate(frame, length)
        if place == 0:
            engine.malformed += 1
            _stray(columns, columns.rx_port[i], frame)
            continue
        frame_id = framing.identity(frame, place)
        number = lookup_find(table, consumers, columns.rx_port[i], frame_id, mac_at(frame, 0))
        if number < 0:
            # multicast frames have no consumer here; unicast frames count only for their own destination
            engine.unknown += 1
            _stray(columns, columns.rx_port[i], frame)
            continue
        consumer = consumers[number]
        # chosen once for check and acceptance
        is_rtc = consumer.framing == FRAMING_RTC and place < class1.LEAST_PLACE
        data = int(check_rtc(consumer, frame, length, place) if is_rtc else check(consumer, frame, length, place))
        if data == 0:
            continue
        if consumer.impairment > 0:
            # in a copy, which may change: the frame itself is the sender's, or the socket's
            copy_octets(columns.rx_octets[CHANGED_AT:], frame, length)
            frame = columns.rx_octets[CHANGED_AT:]
            if not _comes_through(columns, number, frame, length, place, data, columns.rx_ns[i]):
                continue
        if is_rtc:
            accept_rtc(
                engine, events, images, consumers, columns.consumed, columns.piece,
                number, consumer, frame, length, data, columns.rx_ns[i],
            )  # fmt: skip
        else:
            accept(
                engine, events, images, consumers, columns.consumed, columns.piece,
                number, consumer, frame, length, data, columns.rx_ns[i],
            )  # fmt: skip


@compiled
def receive_at(columns: Columns, octets: Any, places: Any, count: int) -> None:
    """:func:`receive_from` as a function of its own."""
    receive_from(columns, octets, places, count)


@compiled
def receive(columns: Columns, count: int) -> None:
    """Take ``count`` frames out of the receive slots; one with an error is only counted."""
    receive_at(columns, columns.rx_octets, columns.rx_slot, count)


@inlined
def _take_back(consumer: Any, image: Any) -> None:
    """Clear the set points of a consumer that ended, because the next one may carry another telegram.

    Set points that it did not bring, but a parameter wrote, stay.
    """
    if image.valid or image.lost == LOST_STOP:
        image.valid = 0
        image.lost = LOST_CLOSED
    zero(consumer, image)
    consumer.fed = 0


@compiled
def _lose(consumers: Any, images: Any, stored: Any, pieces: Any, number: int) -> None:
    """The data hold timer of a consumer ran out: nothing that it brings is valid."""
    consumer = consumers[number]
    if consumer.pieces:
        spoil_pieces(consumer, pieces, stored)
    following = number + 1
    while following > 0:
        consumer = consumers[following - 1]
        following = consumer.rider
        image = images[consumer.image]
        if consumer.feeds and (image.valid or image.lost == LOST_STOP):
            image.valid = 0
            image.lost = LOST_EXPIRED


@inlined
def _watch(engine: Any, consumers: Any, images: Any, stored: Any, pieces: Any, events: Any, now: int) -> None:
    """Data hold timers, and rows that the station opened or closed since the last tick."""
    for number in range(engine.cpm_rows):
        consumer = consumers[number]
        if consumer.active == 0:
            if consumer.state != IDLE:
                if consumer.fed or consumer.feeds:
                    _take_back(consumer, images[consumer.image])
                if consumer.pieces:
                    spoil_pieces(consumer, pieces, stored)
                # last: from here on the row may be another connection's
                consumer.state = IDLE
        elif consumer.fed and not consumer.feeds:
            _take_back(consumer, images[consumer.image])
        elif consumer.state == IDLE:
            consumer.state = FRUN
            consumer.last_ns = now
        elif consumer.state == RUN and now - consumer.last_ns > consumer.hold_ns:
            consumer.state = W_START
            consumer.expirations += 1
            _lose(consumers, images, stored, pieces, number)
            emit(engine, events, EXPIRED, number, now, now - consumer.last_ns)
        elif consumer.state == FRUN and consumer.first_hold_ns > 0 and now - consumer.last_ns > consumer.first_hold_ns:
            consumer.state = W_START
            consumer.expirations += 1
            emit(engine, events, EXPIRED, number, now, now - consumer.last_ns)


@compiled
def _faults(faults: Any) -> int:
    """Number of faults of the active situation."""
    count = 0
    while count < FAULT_SLOTS and faults.code[count] != 0:
        count += 1
    return count


@inlined
def _has_work_each_tick(axis: Any) -> int:
    """Whether an axis counts its controller's sign of life, exchanges parameters, or has a clock of its own."""
    return int(axis.life.settings.watched != 0 or axis.clock.settings.drift != 0.0 or has_parameter_channel(axis))


@inlined
def run_firmware(columns: Columns, now: int) -> None:
    """Step every drive and every program that is due, and report what changed."""
    engine = columns.engine[0]
    events = columns.events
    for number in range(engine.axis_rows):
        axis = columns.axis[number]
        if axis.front == 0:
            continue
        if axis.each_tick == 0 and now - axis.last_ns < axis.step_ns:
            # all that this needs is in the row's first cache line
            continue
        own = now
        if axis.clock.settings.drift != 0.0:
            own = drive_time(axis.clock, now)
        if axis.life.settings.watched and axis.powered:
            count_life(axis, columns.image[number])
        if tells(axis, columns.image[number], own):
            emit(engine, events, PARAMETER_TASK, number, now, int(columns.image[number].parameter_task))
        if own - axis.last_ns < axis.step_ns:
            continue
        state = axis.drive.state
        faults = _faults(axis.faults)
        fault_ns = axis.faults.since_ns
        fault_ends = axis.faults.ends
        reacted = axis.faults.reacted
        warning = axis.warnings.code
        refused = axis.faults.refused
        _step(axis, columns.image[number], own)
        axis.each_tick = _has_work_each_tick(axis)
        if axis.drive.state != state:
            emit(engine, events, STATE_CHANGED, number, now, (int(state) << 8) | int(axis.drive.state))
        # before the faults are over: the acknowledgement is the change that ends them
        observe(engine, events, columns.observed[number], axis, columns.image[number], number, now)
        if axis.faults.ends != fault_ends and faults:
            emit(engine, events, FAULTS_CLEARED, number, now, own - fault_ns)
            fault_ended(columns.observed[number])
            faults = 0
        for i in range(faults, _faults(axis.faults)):
            emit(engine, events, FAULT_RAISED, number, now, int(axis.faults.code[i]) & NUMBER_MASK)
            fault_began(columns.observed[number], now)
        if axis.faults.reacted and not reacted and axis.faults.since_ns != 0:
            emit(engine, events, FAULT_REACTED, number, now, own - axis.faults.since_ns)
        if axis.faults.refused != refused:
            emit(engine, events, ACKNOWLEDGE_REFUSED, number, now, int(axis.faults.refused))
        if axis.warnings.code != warning:
            emit(engine, events, WARNING_CHANGED, number, now, int(axis.warnings.code))
    for number in range(engine.program_rows):
        program = columns.program[number]
        if program.active == 0:
            continue
        phase = program.phase
        step_program(program, columns.image[number], now)
        if program.phase != phase:
            emit(engine, events, PHASE_CHANGED, number, now, (int(phase) << 8) | int(program.phase))


@inlined
def _go_on(provider: Any, cycles: int) -> None:
    """Set the next frame's due time this many cycles later, by the provider's own clock."""
    provider.next_ns += cycles * provider.cycle_ns
    if provider.slip_ns != 0.0:
        slipped = provider.slipped_ns + cycles * provider.slip_ns
        whole = int(slipped)
        provider.next_ns -= whole
        provider.slipped_ns = slipped - whole


@inlined
def transmit(columns: Columns, now: int) -> int:
    """Fill every frame that is due; their rows are in ``tx_row``, the count is returned."""
    engine, providers, images, frames = columns.engine[0], columns.ppm, columns.image, columns.frames
    impairments, held, held_order, tx_row = columns.impairment, columns.held, columns.held_order, columns.tx_row
    stored, pieces = columns.provided, columns.piece
    count = 0
    overrun = False
    engine.busy_out = 0
    if engine.held_out > 0:
        count = _release_sent(engine, held, held_order[OUTWARD], impairments, tx_row, providers.shape[0], now, count)
    for number in range(engine.ppm_rows):
        provider = providers[number]
        if provider.active != OPEN:
            if provider.active == CLOSED and provider.state != IDLE:
                provider.state = IDLE
                if engine.held_out > 0:
                    forget(held, held_order[OUTWARD], int(engine.held_out), number)
            continue
        if provider.state == IDLE:
            # first frame on the grid of the cycle, so that all channels of one cycle share their ticks
            provider.next_ns = now - now % provider.cycle_ns + provider.phase_ns
            if provider.next_ns < now:
                provider.next_ns += provider.cycle_ns
            framing.start(provider)
            provider.state = W_START
        late = now - provider.next_ns
        if late < 0:
            continue
        if late >= provider.cycle_ns:
            skipped = late // provider.cycle_ns
            provider.late += skipped
            _go_on(provider, skipped)
            framing.advance(provider, skipped)
            overrun = True
        _go_on(provider, 1)
        framing.advance(provider, 1)
        provider.state = RUN
        frame = frames[number]
        if provider.framing == FRAMING_RTC:
            pack_rtc(provider, images, providers, stored, pieces, frame)
        else:
            pack(provider, images, providers, stored, pieces, frame)
        outcome = GOES_ON
        if provider.impairment > 0:
            outcome = impair_sent(
                engine, impairments, provider, held, held_order, frames, providers.shape[0], number, now
            )
        if outcome == IS_LOST:
            provider.suppressed += 1
            continue
        provider.sent += 1
        provider.last_ns = now
        if outcome == GOES_ON:
            tx_row[count] = number
            count += 1
    if engine.held_out > 0:
        count = _release_sent(engine, held, held_order[OUTWARD], impairments, tx_row, providers.shape[0], now, count)
    if overrun:
        engine.overruns += 1
    engine.sent += count
    return count


@inlined
def one_tick(columns: Columns, now: int) -> int:
    """One tick, after the frames that came in; returns how many frames to send."""
    engine = columns.engine[0]
    if engine.ended != engine.ended_seen:
        _release_ended(columns)
    if engine.held_in > 0:
        _release_received(columns, now)
    _watch(engine, columns.cpm, columns.image, columns.consumed, columns.piece, columns.events, now)
    moment = now
    if engine.plant_call != 0:
        moment = plant_moment(engine, now)
    while True:
        run_firmware(columns, moment)
        if engine.plant_call == 0:
            break
        step_plant(engine, moment)
        if moment >= now:
            break
        moment = plant_moment(engine, now)
    if engine.trace_rows != 0:
        sample(
            engine,
            columns.events,
            columns.trace,
            columns.probe,
            columns.trace_ring,
            columns.axis_reals,
            columns.axis_words,
            columns.image_words,
            columns.provided,
            columns.consumed,
            now,
        )
    if engine.condition_rows != 0:
        watch_conditions(
            engine,
            columns.events,
            columns.condition,
            columns.condition_op,
            columns.axis_reals,
            columns.axis_words,
            now,
        )
    engine.now_ns = now
    engine.cycles += 1
    return transmit(columns, now)


@compiled
def tick(columns: Columns, count: int, now: int) -> int:
    """One whole tick with ``count`` received frames; returns how many frames to send."""
    receive(columns, count)
    return one_tick(columns, now)


@compiled
def next_step(columns: Columns, now: int) -> int:
    """When the next tick is due where nothing is sent by rows: as a drive steps, a trace or a condition is looked at.

    On the grid of ``tick_ns``.  What a clock drifts in one step is neglected: its drive steps a tick later at the most.
    """
    engine, axes = columns.engine[0], columns.axis
    first = now + engine.tick_ns
    if engine.trace_rows == 0 and engine.condition_rows == 0 and engine.program_rows == 0 and engine.plant_call == 0:
        first = now + LONGEST_STEP_NS
        for number in range(engine.axis_rows):
            axis = axes[number]
            if axis.front == 0:
                continue
            due = axis.last_ns + axis.step_ns
            if axis.clock.settings.drift != 0.0:
                due -= drive_time(axis.clock, now) - now
            first = min(first, due)
    grid = engine.tick_ns
    return int(max((first + grid - 1) // grid, now // grid + 1) * grid)


@inlined
def first_due(columns: Columns, now: int) -> int:
    """When the next tick is due: at the next frame to send, at the latest ``tick_ns`` from ``now``."""
    engine, providers, held, held_order = columns.engine[0], columns.ppm, columns.held, columns.held_order
    # on the grid of tick_ns, so that a farm at rest and a farm at work tick at the same times
    due = now - now % engine.tick_ns + engine.tick_ns
    if engine.plant_call != 0 and engine.plant_due_ns > now:
        due = min(due, int(engine.plant_due_ns))
    for number in range(engine.ppm_rows):
        provider = providers[number]
        if provider.active == OPEN and provider.state != IDLE and provider.next_ns < due:
            due = provider.next_ns
    if engine.held_out > 0:
        due = min(due, max(now, held[held_order[OUTWARD, 0]].due_ns))
    if engine.held_in > 0:
        due = min(due, max(now, held[held_order[INWARD, 0]].due_ns))
    return int(due)


@compiled
def next_due(columns: Columns, now: int) -> int:
    """:func:`first_due` for callers in Python."""
    return first_due(columns, now)
