"""What the decoder of a capture keeps is bounded, and forgets what was not seen for the longest time."""

from __future__ import annotations

from pnfarm.buses import registry
from pnfarm.captures.reading import CapturedFrame

MS = 1_000_000


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
