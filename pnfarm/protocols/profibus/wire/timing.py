"""Times of the line by its baud rate (EN 50170 part 2, 4.1.7 and 4.7.3; part 3 for DP)."""

from __future__ import annotations

from typing import Final

from pnfarm.protocols.profibus.wire.telegram import LONGEST_TELEGRAM

__all__ = [
    "BAUD_RATES", "BITS_OF_OCTET", "LEAST_TSDR_BITS", "SYN_BITS", "answered_within_ns", "bits_ns", "line_ns",
    "longest_tsdr_bits",
]  # fmt: skip

#: Start bit, eight of data, even parity, stop bit.
BITS_OF_OCTET: Final = 11
#: The line rests for so long before each request.
SYN_BITS: Final = 33
#: Least time from the last bit of a request to the first one of its answer, unless Set_Prm asks for more.
LEAST_TSDR_BITS: Final = 11
#: Baud rate -> longest such time, and the usual slot time, bits.
_TIMES: Final = {
    9_600: (60, 100),
    19_200: (60, 100),
    31_250: (60, 100),
    45_450: (250, 640),
    93_750: (60, 100),
    187_500: (60, 100),
    500_000: (100, 200),
    1_500_000: (150, 300),
    3_000_000: (250, 400),
    6_000_000: (450, 600),
    12_000_000: (800, 1000),
}
BAUD_RATES: Final = tuple(_TIMES)


def longest_tsdr_bits(baud: int) -> int:
    """The longest time that a slave may take to begin its answer; for another rate, that of the next lower one."""
    return _times(baud)[0]


def _times(baud: int) -> tuple[int, int]:
    return _TIMES[max((rate for rate in _TIMES if rate <= baud), default=BAUD_RATES[0])]


def bits_ns(bits: int, baud: int) -> int:
    """So many bits of the line, ns."""
    return bits * 1_000_000_000 // baud


def line_ns(octets: int, baud: int) -> int:
    """How long so many octets are on the line, ns."""
    return bits_ns(octets * BITS_OF_OCTET, baud)


def answered_within_ns(octets: int, baud: int) -> int:
    """From the begin of a request of so many octets to the end of its answer: the longest one, after the slot time."""
    return line_ns(octets + LONGEST_TELEGRAM, baud) + bits_ns(_times(baud)[1], baud)
