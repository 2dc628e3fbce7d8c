"""The counts of NDR arguments, changed so that they contradict each other."""

from pnfarm.protocols.profinet.wire.rpc.pdu import RequestArgs, emit_request_args

#: Where each stands in the stub.
_PLACES = {"args_maximum": 0, "args_length": 4, "maximum_count": 8, "offset": 12, "actual_count": 16}


def with_counts(stub: bytes, *, little_endian: bool = True, **counts: int) -> bytes:
    """A stub with other counts than its own."""
    octets = bytearray(stub)
    for name, count in counts.items():
        place = _PLACES[name]
        octets[place : place + 4] = count.to_bytes(4, "little" if little_endian else "big")
    return bytes(octets)


def counted(maximum: int, payload: bytes, *, little_endian: bool = True, **counts: int) -> bytes:
    """The stub of a request with such counts."""
    stub = emit_request_args(RequestArgs(maximum, payload), little_endian=little_endian)
    return with_counts(stub, little_endian=little_endian, **counts)
