"""One tick of the engine: frames in, watchdogs, firmware, frames out.

The same functions serve the real-time loop and virtual time, drives and controllers.  A tick never waits,
never allocates and accesses nothing but the table.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine import framing
from pnfarm.engine.columns import Columns, lookup_find
from pnfarm.engine.conditions import watch_conditions
from pnfarm.engine.held import forget, release_all, take_first
from pnfarm.engine.impair import GOES_ON, HELD, IS_LOST, WAS_CHANGED, impair_received, impair_sent
from pnfarm.engine.intervals import measure_interval
from pnfarm.engine.observe import fault_began, fault_ended, observe
from pnfarm.engine.tracing import sample
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.causes import NUMBER_MASK
from pnfarm.firmware.drive_clock import drive_time
from pnfarm.firmware.profidrive.axis_program import step_program
from pnfarm.firmware.profidrive.parameter_words import exchange
from pnfarm.firmware.profidrive.sign_of_life import count_life
from pnfarm.firmware.step import step
from pnfarm.table.axis_codes import FAULT_SLOTS
from pnfarm.table.by_address import by_address
from pnfarm.table.channel import (
    DISCARD_IMPAIRED,
    DISCARD_LENGTH,
    DISCARD_SOURCE,
    FRUN,
    IDLE,
    IOXS_BAD,
    IOXS_GOOD,
    RUN,
    W_START,
)
from pnfarm.table.compiled import compiled
from pnfarm.table.engine_row import (
    ACKNOWLEDGE_REFUSED,
    EXPIRED,
    FAULT_RAISED,
    FAULT_REACTED,
    FAULTS_CLEARED,
    FIRST_FRAME,
    IOPS_CHANGED,
    PARAMETER_TASK,
    PHASE_CHANGED,
    PROVIDER_CHANGED,
    STATE_CHANGED,
    WARNING_CHANGED,
    emit,
)
from pnfarm.table.held import INWARD, OUTWARD
from pnfarm.table.image import IMAGE, LOST_CLOSED, LOST_EXPIRED, LOST_NOT, LOST_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, WORD_NONE

__all__ = ["next_due", "receive", "run_firmware", "tick", "transmit"]

#: Its machine code is one for all loops that tick.
_step = by_address(step, AXIS, IMAGE)


@compiled
def _unpack(consumer: Any, image: Any, frame: Any, data: int) -> None:
    """Telegram words into the process image."""
    for i in range(consumer.words):
        code = int(consumer.word_code[i])
        if code == WORD_NONE:
            continue
        place = data + consumer.word_offset[i]
        word = (int(frame[place]) << 8) | int(frame[place + 1])
        slot = code >> 2
        part = code & 3
        if part == PART_HIGH:
            image.received[slot] = (int(image.received[slot]) & 0xFFFF) | ((word ^ 0x8000) - 0x8000 << 16)
        elif part == PART_LOW:
            image.received[slot] = (int(image.received[slot]) >> 16 << 16) | word
        else:
            image.received[slot] = word


@compiled
def _zero(consumer: Any, image: Any) -> None:
    """The set points that a consumer brings, in the process image."""
    for i in range(consumer.words):
        code = int(consumer.word_code[i])
        if code != WORD_NONE:
            image.received[code >> 2] = 0


@compiled
def _address(frame: Any, place: int) -> int:
    """The MAC address that begins there, as a number."""
    address = 0
    for i in range(place, place + 6):
        address = (address << 8) | int(frame[i])
    return address


@compiled
def _check(consumer: Any, frame: Any, length: int, place: int) -> int:
    """A frame of this consumer, with its id at ``place``, as the CPM checks it: where its data begin, 0: discarded."""
    data = framing.fits(consumer, length, place)
    if data == 0:
        consumer.discarded[DISCARD_LENGTH] += 1
        return 0
    if _address(frame, 6) != consumer.source:
        consumer.discarded[DISCARD_SOURCE] += 1
        return 0
    return int(data)


@compiled
def _comes_through(columns: Columns, number: int, frame: Any, length: int, place: int, data: int, arrival: int) -> bool:
    """Whether a frame of a consumer with impairments goes on now.  Called for those only: all columns cost 200 ns."""
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
    if outcome == WAS_CHANGED and not _is_for(consumer, frame, length, place):
        engine.unknown += 1
        return False
    return bool(outcome < HELD)


@compiled
def _is_for(consumer: Any, frame: Any, length: int, place: int) -> bool:
    """Whether a frame that was changed on its way is still one of this consumer."""
    if framing.locate(frame, length) != place or _address(frame, 6) != consumer.source:
        return False
    frame_id = (int(frame[place]) << 8) | int(frame[place + 1])
    return bool(frame_id == consumer.frame_id and _address(frame, 0) == consumer.destination)


@compiled
def _accept(
    engine: Any,
    events: Any,
    images: Any,
    number: int,
    consumer: Any,
    frame: Any,
    length: int,
    data: int,
    arrival: int,
) -> None:
    """Take the data of a frame that has come through, unless the CPM refuses it."""
    why = framing.refused(consumer, frame, length)
    if why >= 0:
        consumer.discarded[why] += 1
        return

    iops = IOXS_GOOD
    for i in range(consumer.iops_count):
        if not frame[data + consumer.iops_offset[i]] & IOXS_GOOD:
            iops = IOXS_BAD
    image = images[consumer.image]
    first = consumer.state != RUN
    if consumer.feeds:
        image.interval_ns = 0 if first else arrival - consumer.last_ns
        image.frame_ns = arrival
    if first:
        consumer.state = RUN
        emit(engine, events, FIRST_FRAME, number, arrival, consumer.generation)
    else:
        measure_interval(engine, consumer, arrival, framing.elapsed(consumer, frame, length))
    runs = framing.provider_runs(consumer, frame, length)
    if first or runs != framing.provider_ran(consumer):
        emit(engine, events, PROVIDER_CHANGED, number, arrival, 1 if runs else 0)
    if first or iops != consumer.iops:
        emit(engine, events, IOPS_CHANGED, number, arrival, 1 if iops == IOXS_GOOD else 0)
    framing.take(consumer, frame, length)
    consumer.iops = iops
    consumer.impaired = 0
    consumer.last_ns = arrival
    consumer.received += 1
    if consumer.feeds == 0:
        return
    if runs and iops == IOXS_GOOD:
        _unpack(consumer, image, frame, data)
        image.frames = (int(image.frames) + 1) & 0xFFFFFFFF
        consumer.fed = 1
        image.valid = 1
        image.lost = LOST_NOT
    elif image.valid:
        image.valid = 0
        image.lost = LOST_STOP
        if consumer.zeroes:
            _zero(consumer, image)


@compiled
def _stray(columns: Columns, port: int, frame: Any) -> None:
    """Count a frame that belongs to no channel for the station at whose port it came in.

    Frames for other stations, which a bridge floods, do not count.
    """
    images = columns.image
    for i in range(len(images)):
        if images[i].port == port:
            if frame[0] & 1 or _address(frame, 0) == images[i].mac:
                images[i].strays += 1
            return


@compiled
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
        data = framing.fits(consumer, length, int(item.place))
        if data == 0 or not _is_for(consumer, frame, length, int(item.place)):
            engine.unknown += 1
            continue
        _accept(engine, columns.events, columns.image, int(item.row), consumer, frame, length, data, int(item.due_ns))


@compiled
def _release_sent(columns: Columns, now: int, count: int) -> int:
    """Send the held frames that are due, behind the ``count`` frames in ``tx_row``; the new count."""
    engine = columns.engine[0]
    store = columns.ppm.shape[0]
    order = columns.held_order[OUTWARD]
    while engine.held_out > 0 and count < columns.tx_row.shape[0] and columns.held[order[0]].due_ns <= now:
        slot = take_first(columns.held, order, int(engine.held_out), columns.impairment)
        engine.held_out -= 1
        engine.busy_out += 1
        if columns.held[slot].row >= 0:
            columns.tx_row[count] = store + slot
            count += 1
    return count


@compiled
def _release_ended(columns: Columns, now: int) -> None:
    """Let frames go on whose impairment has ended."""
    engine = columns.engine[0]
    engine.ended_seen = engine.ended
    release_all(columns.held, columns.held_order[OUTWARD], int(engine.held_out), columns.impairment, now)
    release_all(columns.held, columns.held_order[INWARD], int(engine.held_in), columns.impairment, now)


@compiled
def receive(columns: Columns, count: int) -> None:
    """Take ``count`` frames out of the receive slots; one with an error is only counted."""
    engine = columns.engine[0]
    engine.received += count
    table = columns.lookup[engine.lookup]
    consumers = columns.cpm
    events = columns.events
    images = columns.image
    for i in range(count):
        if engine.held_in > 0:
            _release_received(columns, columns.rx_ns[i])
        frame = columns.rx_frames[i]
        length = int(columns.rx_length[i])
        place = framing.locate(frame, length)
        if place == 0:
            engine.malformed += 1
            _stray(columns, columns.rx_port[i], frame)
            continue
        frame_id = (int(frame[place]) << 8) | int(frame[place + 1])
        number = lookup_find(table, consumers, columns.rx_port[i], frame_id)
        if number < 0 or _address(frame, 0) != consumers[number].destination:
            # multicast frames have no consumer here; unicast frames count only for their own destination
            engine.unknown += 1
            _stray(columns, columns.rx_port[i], frame)
            continue
        consumer = consumers[number]
        data = _check(consumer, frame, length, place)
        if data == 0:
            continue
        if consumer.impairment > 0 and not _comes_through(
            columns, number, frame, length, place, data, columns.rx_ns[i]
        ):
            continue
        _accept(engine, events, images, number, consumer, frame, length, data, columns.rx_ns[i])


@compiled
def _take_back(consumer: Any, image: Any) -> None:
    """Clear the set points of a consumer that ended, because the next one may carry another telegram.

    Set points that it did not bring, but a parameter wrote, stay.
    """
    if image.valid or image.lost == LOST_STOP:
        image.valid = 0
        image.lost = LOST_CLOSED
    _zero(consumer, image)
    consumer.fed = 0


@compiled
def _watch(columns: Columns, now: int) -> None:
    """Data hold timers, and rows that the station opened or closed since the last tick."""
    engine = columns.engine[0]
    for number in range(engine.cpm_rows):
        consumer = columns.cpm[number]
        if consumer.active == 0:
            if consumer.state != IDLE:
                consumer.state = IDLE
                if consumer.fed or consumer.feeds:
                    _take_back(consumer, columns.image[consumer.image])
        elif consumer.fed and not consumer.feeds:
            _take_back(consumer, columns.image[consumer.image])
        elif consumer.state == IDLE:
            consumer.state = FRUN
            consumer.last_ns = now
        elif consumer.state == RUN and now - consumer.last_ns > consumer.hold_ns:
            consumer.state = W_START
            consumer.expirations += 1
            if consumer.feeds:
                image = columns.image[consumer.image]
                if image.valid or image.lost == LOST_STOP:
                    image.valid = 0
                    image.lost = LOST_EXPIRED
            emit(engine, columns.events, EXPIRED, number, now, now - consumer.last_ns)


@compiled
def _faults(faults: Any) -> int:
    """Number of faults of the active situation."""
    count = 0
    while count < FAULT_SLOTS and faults.code[count] != 0:
        count += 1
    return count


@compiled
def run_firmware(columns: Columns, now: int) -> None:
    """Step every drive and every program that is due, and report what changed."""
    engine = columns.engine[0]
    events = columns.events
    for number in range(engine.axis_rows):
        axis = columns.axis[number]
        if axis.front == 0:
            continue
        own = now
        if axis.clock.settings.drift != 0.0:
            own = drive_time(axis.clock, now)
        if axis.life.settings.watched and axis.powered:
            count_life(axis, columns.image[number])
        if axis.profidrive.settings.parameter_channel and exchange(columns.image[number], own):
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


@compiled
def _pack(provider: Any, image: Any, frame: Any) -> None:
    """The process image into telegram words, provider status, header and trailer."""
    for i in range(provider.words):
        code = int(provider.word_code[i])
        word = 0
        if code != WORD_NONE:
            value = int(image.sent[code >> 2])
            word = (value >> 16) & 0xFFFF if code & 3 == PART_HIGH else value & 0xFFFF
        place = provider.word_offset[i]
        frame[place] = word >> 8
        frame[place + 1] = word & 0xFF
    status = IOXS_GOOD if image.good else IOXS_BAD
    for i in range(provider.iops_count):
        frame[provider.iops_offset[i]] = status
    framing.seal(provider, frame)


@compiled
def _go_on(provider: Any, cycles: int) -> None:
    """Set the next frame's due time this many cycles later, by the provider's own clock."""
    provider.next_ns += cycles * provider.cycle_ns
    if provider.slip_ns != 0.0:
        slipped = provider.slipped_ns + cycles * provider.slip_ns
        whole = int(slipped)
        provider.next_ns -= whole
        provider.slipped_ns = slipped - whole


@compiled
def transmit(columns: Columns, now: int) -> int:
    """Fill every frame that is due; their rows are in ``tx_row``, the count is returned."""
    engine = columns.engine[0]
    count = 0
    overrun = False
    engine.busy_out = 0
    if engine.held_out > 0:
        count = _release_sent(columns, now, count)
    for number in range(engine.ppm_rows):
        provider = columns.ppm[number]
        if provider.active == 0:
            if provider.state != IDLE:
                provider.state = IDLE
                if engine.held_out > 0:
                    forget(columns.held, columns.held_order[OUTWARD], int(engine.held_out), number)
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
        frame = columns.frames[number]
        image = columns.image[provider.image]
        _pack(provider, image, frame)
        image.filled = (int(image.filled) + 1) & 0xFFFFFFFF
        outcome = GOES_ON
        if provider.impairment > 0:
            outcome = impair_sent(
                engine, columns.impairment, provider, columns.held, columns.held_order, columns.frames,
                columns.ppm.shape[0], number, now,
            )  # fmt: skip
        if outcome == IS_LOST:
            provider.suppressed += 1
            continue
        provider.sent += 1
        provider.last_ns = now
        if outcome == GOES_ON:
            columns.tx_row[count] = number
            count += 1
    if engine.held_out > 0:
        count = _release_sent(columns, now, count)
    if overrun:
        engine.overruns += 1
    engine.sent += count
    return count


@compiled
def tick(columns: Columns, count: int, now: int) -> int:
    """One whole tick with ``count`` received frames; returns how many frames to send."""
    engine = columns.engine[0]
    if engine.ended != engine.ended_seen:
        _release_ended(columns, now)
    receive(columns, count)
    if engine.held_in > 0:
        _release_received(columns, now)
    _watch(columns, now)
    run_firmware(columns, now)
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
def next_due(columns: Columns, now: int) -> int:
    """When the next tick is due: at the next frame to send, at the latest ``tick_ns`` from ``now``."""
    engine = columns.engine[0]
    # on the grid of tick_ns, so that a farm at rest and a farm at work tick at the same times
    due = now - now % engine.tick_ns + engine.tick_ns
    for number in range(engine.ppm_rows):
        provider = columns.ppm[number]
        if provider.active != 0 and provider.state != IDLE and provider.next_ns < due:
            due = provider.next_ns
    if engine.held_out > 0:
        due = min(due, max(now, columns.held[columns.held_order[OUTWARD, 0]].due_ns))
    if engine.held_in > 0:
        due = min(due, max(now, columns.held[columns.held_order[INWARD, 0]].due_ns))
    return due
