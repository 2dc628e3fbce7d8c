"""What the decoder of a capture keeps is bounded, and forgets what was not seen for the longest time."""

from __future__ import annotations

from pnfarm.buses import registry
from pnfarm.captures.reading import CapturedFrame

MS = 1_000_000
MOST_CHANNELS = 4096


def question(station: int) -> bytes:
    """An ARP question of a station, a broadcast that each interface of a capture has."""
    mac, ip = bytes([2, 0, 0, 0]) + station.to_bytes(2, "big"), bytes([10, 0]) + station.to_bytes(2, "big")
    return b"\xff" * 6 + mac + bytes.fromhex("0806000108000604 0001") + mac + ip + bytes(6) + bytes([10, 0, 255, 1])


def test_a_copy_at_another_interface_is_left_out_however_many_other_stations_there_are() -> None:
    decoder = registry.decoder()
    numbers = iter(range(1, 100_000))

    def lines(station: int, time_ns: int, interface: str) -> int:
        return len(decoder.feed(CapturedFrame(next(numbers), time_ns, question(station), interface)))

    assert lines(0, 0, "axis-01") == 1
    for other in range(1, 256):
        assert lines(other, MS, "axis-01") == 1
    # it asks again, and a station that was silent so far has a question, too, before the copy comes
    assert lines(0, 1000 * MS, "axis-01") == 1
    assert lines(300, 1000 * MS, "axis-01") == 1
    assert lines(0, 1001 * MS, "axis-02") == 0


def test_cyclic_data_that_go_on_are_known_however_many_other_connections_there_were() -> None:
    decoder = registry.decoder()
    begun = []

    def cyclic(station: int, now: int) -> None:
        head = bytes([2, 0, 0, 0, 0, 1, 2, 0, 0, 0]) + station.to_bytes(2, "big") + b"\x88\x92\x80\x00"
        frame = CapturedFrame(now, now * MS, head + bytes(40) + (now * 32 & 0xFFFF).to_bytes(2, "big") + b"\x35\0")
        begun.extend(station for line in decoder.feed(frame) if line.description.what == "cyclic data begin")

    for other in range(1, MOST_CHANNELS + 10):
        cyclic(0, 2 * other)
        cyclic(other, 2 * other + 1)
    assert begun.count(0) == 1
