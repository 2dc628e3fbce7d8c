"""What a consumer does with a frame that came to it: checks, events, the process image.

It is made once for each framing, so that a frame pays one choice for its framing, and no more for every further one.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import class1, rtc
from pnfarm.engine.channels.intervals import measure_interval
from pnfarm.engine.channels.plain_data import take_pieces
from pnfarm.table.channel import (
    DISCARD_INVALID,
    DISCARD_LENGTH,
    DISCARD_SOURCE,
    FRAMING_CLASS1,
    FRAMING_RTC,
    IOXS_BAD,
    IOXS_GOOD,
    RUN,
)
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.engine_row import FIRST_FRAME, IOPS_CHANGED, PROVIDER_CHANGED, emit
from pnfarm.table.image import LOST_NOT, LOST_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, WORD_NONE

__all__ = ["accept", "accept_rtc", "check", "check_rtc", "zero"]


@inlined
def zero(consumer: Any, image: Any) -> None:
    """The set points that a consumer brings, in the process image."""
    for i in range(consumer.words):
        code = int(consumer.word_code[i])
        if code != WORD_NONE:
            image.received[code >> 2] = 0


def _made_for(framing: Any, first: int) -> tuple[Any, Any]:
    """Check and acceptance for one framing, a module as :mod:`pnfarm.engine.channels.rtc`.

    ``first`` is 1 where the more significant octet of a telegram word is the second one.
    """

    @inlined
    def _unpack(consumer: Any, image: Any, frame: Any, data: int) -> None:
        """Telegram words into the process image."""
        for i in range(consumer.words):
            code = int(consumer.word_code[i])
            if code == WORD_NONE:
                continue
            place = data + consumer.word_offset[i]
            word = (int(frame[place + first]) << 8) | int(frame[place + (1 - first)])
            slot = code >> 2
            part = code & 3
            if part == PART_HIGH:
                image.received[slot] = (int(image.received[slot]) & 0xFFFF) | ((word ^ 0x8000) - 0x8000 << 16)
            elif part == PART_LOW:
                image.received[slot] = (int(image.received[slot]) >> 16 << 16) | word
            else:
                image.received[slot] = word

    @inlined
    def _worst(consumer: Any, frame: Any, data: int) -> int:
        """GOOD if each provider status is."""
        iops = IOXS_GOOD
        for i in range(consumer.iops_count):
            if not frame[data + consumer.iops_offset[i]] & IOXS_GOOD:
                iops = IOXS_BAD
        return iops

    @inlined
    def _feed(consumer: Any, image: Any, frame: Any, data: int, good: bool) -> None:
        """The set points of a consumer that feeds its axis."""
        if good:
            _unpack(consumer, image, frame, data)
            image.frames = (int(image.frames) + 1) & 0xFFFFFFFF
            consumer.fed = 1
            image.valid = 1
            image.lost = LOST_NOT
        elif image.valid:
            image.valid = 0
            image.lost = LOST_STOP
            if consumer.zeroes:
                zero(consumer, image)

    @compiled
    def _pass_on(
        consumers: Any, images: Any, first: int, frame: Any, data: int, runs: bool, arrival: int, interval: int
    ) -> None:
        """The parts of a frame for the further axes of a station."""
        following = first
        while following > 0:
            rider = consumers[following - 1]
            following = rider.rider
            rider.iops = _worst(rider, frame, data)
            if rider.feeds:
                image = images[rider.image]
                image.interval_ns = interval
                image.frame_ns = arrival
                _feed(rider, image, frame, data, runs and rider.iops == IOXS_GOOD)

    @compiled
    def _check(consumer: Any, frame: Any, length: int, place: int) -> int:
        data = framing.fits(consumer, frame, length, place)
        if data == 0:
            consumer.discarded[DISCARD_LENGTH] += 1
            return 0
        if not framing.comes_from(consumer, frame):
            consumer.discarded[DISCARD_SOURCE] += 1
            return 0
        return int(data)

    @inlined
    def _accept(
        engine: Any,
        events: Any,
        images: Any,
        consumers: Any,
        stored: Any,
        pieces: Any,
        number: int,
        consumer: Any,
        frame: Any,
        length: int,
        data: int,
        arrival: int,
    ) -> None:
        why = framing.refused(consumer, frame, length, data)
        if why >= 0:
            consumer.discarded[why] += 1
            return

        iops = _worst(consumer, frame, data)
        image = images[consumer.image]
        begins = consumer.state != RUN
        if framing.repeats(consumer, frame, data):
            measure_interval(engine, consumer, arrival, framing.elapsed(consumer, frame, length, data))
            framing.take(consumer, frame, length, data)
            consumer.impaired = 0
            consumer.last_ns = arrival
            consumer.received += 1
            return
        if consumer.feeds:
            image.interval_ns = 0 if begins else arrival - consumer.last_ns
            image.frame_ns = arrival
        if begins:
            emit(engine, events, FIRST_FRAME, number, arrival, consumer.generation)
        else:
            measure_interval(engine, consumer, arrival, framing.elapsed(consumer, frame, length, data))
        runs = framing.provider_runs(consumer, frame, length, data) != 0
        if begins or runs != (framing.provider_ran(consumer) != 0):
            emit(engine, events, PROVIDER_CHANGED, number, arrival, 1 if runs else 0)
        if begins or iops != consumer.iops:
            emit(engine, events, IOPS_CHANGED, number, arrival, 1 if iops == IOXS_GOOD else 0)
        framing.take(consumer, frame, length, data)
        if consumer.rider:
            interval = 0 if begins else arrival - consumer.last_ns
            _pass_on(consumers, images, int(consumer.rider), frame, data, runs, arrival, interval)
        if consumer.pieces:
            take_pieces(consumer, pieces, stored, frame, data, runs)
        # after what compares a packet with the one before: a connection's first one has none
        consumer.state = RUN
        consumer.iops = iops
        consumer.impaired = 0
        consumer.last_ns = arrival
        consumer.received += 1
        if consumer.feeds:
            _feed(consumer, image, frame, data, runs and iops == IOXS_GOOD)

    return _check, _accept


check_rtc, accept_rtc = _made_for(rtc, 0)
_check_class1, _accept_class1 = _made_for(class1, 1)


@compiled
def check(consumer: Any, frame: Any, length: int, place: int) -> int:
    """A frame of this consumer, with its id at ``place``, as the CPM checks it: where its data begin, 0: discarded."""
    if consumer.framing == FRAMING_RTC and place < class1.LEAST_PLACE:
        return int(check_rtc(consumer, frame, length, place))
    if consumer.framing == FRAMING_CLASS1 and place >= class1.LEAST_PLACE:
        return int(_check_class1(consumer, frame, length, place))
    consumer.discarded[DISCARD_LENGTH] += 1
    return 0


@inlined
def accept(
    engine: Any,
    events: Any,
    images: Any,
    consumers: Any,
    stored: Any,
    pieces: Any,
    number: int,
    consumer: Any,
    frame: Any,
    length: int,
    data: int,
    arrival: int,
) -> None:
    """Take the data of a frame that has come through, unless the CPM refuses it."""
    if consumer.framing == FRAMING_RTC:
        accept_rtc(engine, events, images, consumers, stored, pieces, number, consumer, frame, length, data, arrival)
    elif consumer.framing == FRAMING_CLASS1:
        _accept_class1(
            engine, events, images, consumers, stored, pieces, number, consumer, frame, length, data, arrival
        )
    else:
        consumer.discarded[DISCARD_INVALID] += 1
