"""Plain data between frames and their rows (:mod:`pnfarm.table.plain_data`), piece by piece."""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.engine.memory_order import acquire, release
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD
from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.plain_data import NO_STATUS, NOT_TAKEN, PlainRows

__all__ = ["plain_number", "put_pieces", "spoil_pieces", "take_pieces"]


@compiled
def _half(row: Any, number: int) -> int:
    """Where a half of a row begins."""
    return int(row.begin) + (number & 1) * int(row.length)


@compiled
def _open(row: Any, octets: Any) -> int:
    """Copy the half in force into the other one; returns where that begins."""
    source, target = _half(row, int(row.sequence)), _half(row, int(row.sequence) + 1)
    for i in range(row.length):
        octets[target + i] = octets[source + i]
    return target


@compiled
def _close(row: Any) -> None:
    """Put the half that was written in force."""
    release()
    row.sequence = (int(row.sequence) + 1) & 0xFFFFFFFF


@compiled
def take_pieces(consumer: Any, pieces: Any, stored: PlainRows, frame: Any, data: int, runs: bool) -> None:
    """The pieces of a consumer's frame, whose IO data begin at ``data``; those that are not good keep what they had."""
    row, octets = stored.rows[consumer.plain], stored.octets
    target = _open(row, octets)
    for number in range(consumer.piece, consumer.piece + consumer.pieces):
        piece = pieces[number]
        good = runs and piece.status_frame != NOT_TAKEN
        if good and piece.status_frame != NO_STATUS:
            good = frame[data + piece.status_frame] & IOXS_GOOD != 0
        octets[target + piece.status_place] = IOXS_GOOD if good else IOXS_BAD
        if good:
            place, begin = target + int(piece.place), data + int(piece.frame)
            for i in range(piece.length):
                octets[place + i] = frame[begin + i]
    _close(row)


@compiled
def spoil_pieces(consumer: Any, pieces: Any, stored: PlainRows) -> None:
    """No frames come any more: the pieces keep their data with status BAD."""
    row, octets = stored.rows[consumer.plain], stored.octets
    target = _open(row, octets)
    for number in range(consumer.piece, consumer.piece + consumer.pieces):
        octets[target + pieces[number].status_place] = IOXS_BAD
    _close(row)


@compiled
def put_pieces(provider: Any, pieces: Any, stored: PlainRows, frame: Any, good: int) -> None:
    """The station's data into a provider's frame; ``good`` 0 makes every status BAD.

    The event loop writes a half in microseconds and rests in between, so that the copy is soon whole.
    """
    row, octets = stored.rows[provider.plain], stored.octets
    while True:
        before = row.sequence
        acquire()
        source = _half(row, int(before))
        for number in range(provider.piece, provider.piece + provider.pieces):
            piece = pieces[number]
            place, begin = source + int(piece.place), int(piece.frame)
            for i in range(piece.length):
                frame[begin + i] = octets[place + i]
            if piece.status_frame != NO_STATUS:
                frame[piece.status_frame] = octets[source + piece.status_place] if good else IOXS_BAD
        acquire()
        if row.sequence == before:
            return


@compiled
def plain_number(stored: PlainRows, number: int, place: int, length: int, big: int) -> Any:
    """Up to eight octets of a row as a whole number, of 64 bits without a sign, as they were at one time; 0 of none."""
    row, octets = stored.rows[number], stored.octets
    while True:
        before = row.sequence
        acquire()
        source = _half(row, int(before)) + place
        bits = np.uint64(0)
        if 0 <= place <= int(row.length) - length:
            for i in range(length):
                octet = octets[source + i] if big else octets[source + length - 1 - i]
                bits = (bits << np.uint64(8)) | np.uint64(octet)
        acquire()
        if row.sequence == before:
            return bits
