"""OpENer (an EtherNet/IP adapter in C) as the other implementation: the same sequences, and the class of each answer.

Its program runs in a network namespace of its own, as the peer of another one; ours is the protocol machine in memory,
with the assemblies and the identity of OpENer's sample.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from enip_bench import DRIVE, PEER

from pnfarm.protocols.enip.adapter import Adapter, AdapterData
from pnfarm.protocols.enip.connection import ConnectionKind, ConnectionSettings, IoOffer
from pnfarm.protocols.enip.encapsulation import SendStream, StreamEnd
from pnfarm.protocols.enip.objects.assembly import AssemblyData
from pnfarm.protocols.enip.objects.ethernet_link import EthernetLinkData
from pnfarm.protocols.enip.objects.identity import IdentityData, identity_key
from pnfarm.protocols.enip.objects.tcp_ip import TcpIpData, multicast_address
from tests.fuzz.enip_sequences import OWN, POINTS, Sent, answer_class
from tests.interop.enip_talk import Stream, answers

__all__ = ["OpenerRig", "Ours", "compared"]

ADDRESS = "10.77.0.50"
SECOND = 1_000_000_000
START_SECONDS = 10.0


def _adapter() -> Adapter:
    vendor, device_type, product, revision = OWN
    identity = IdentityData(vendor, device_type, product, revision, 123456789, "OpENer PC", reset=lambda _: 0)
    configuration, output, given = POINTS
    offer = IoOffer(ConnectionKind.EXCLUSIVE_OWNER, output, given, 32, 32, configuration)
    settings = ConnectionSettings(identity_key(identity), (offer,), multicast_address(DRIVE))
    return Adapter(
        AdapterData(
            identity,
            TcpIpData(DRIVE, host_name="axis-01"),
            EthernetLinkData(bytes.fromhex("020000000011")),
            [
                AssemblyData(configuration, 10, lambda: bytes(10)),
                AssemblyData(output, 32, lambda: bytes(32)),
                AssemblyData(given, 32, lambda: bytes(32)),
            ],
            settings,
        )
    )


class Ours:
    """Our adapter, with a new stream for each sequence."""

    def __init__(self) -> None:
        self.adapter = _adapter()
        self.now = SECOND
        self.stream = 0

    def answers(self, sequence: list[Sent]) -> list[bytes | str]:
        self.stream += 1
        self.now += SECOND
        self.adapter.opened(self.stream, PEER, self.now)
        waiting: list[bytes] = []

        def send(octets: bytes) -> None:
            self.adapter.received(self.stream, octets, self.now)
            for output in self.adapter.take_outputs():
                if isinstance(output, SendStream) and output.stream == self.stream:
                    waiting.append(output.data)
                elif output == StreamEnd(self.stream):
                    waiting.append(b"")
            self.adapter.take_events()

        def more() -> bytes | None:
            return waiting.pop(0) if waiting else None

        found = answers(Stream(send, more), [(one.octets, one.live) for one in sequence])
        self.adapter.closed(self.stream, self.now)
        self.adapter.take_outputs()
        return found


class OpenerRig:
    """The program in its namespace, and who talks to it; a context."""

    def __init__(self, program: Path) -> None:
        self.program = program.resolve(strict=True)

    def __enter__(self) -> Self:
        from tests.interop.interop_rig import HERE, Lab

        self._lab = Lab()
        self._folder = tempfile.TemporaryDirectory(prefix="pnfarm-opener-")
        lab = self._lab
        for where, device, address in (("farm", "nic0", ADDRESS), ("peer", "plc0", "10.77.0.1")):
            lab.run(where, "ip", "address", "add", f"{address}/24", "dev", device)
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._opener = lab.start("farm", self.program, "nic0", cwd=self._folder.name, **quiet)
        self._wait()
        self._talk = lab.start(
            "peer", sys.executable, HERE / "enip_talk.py", ADDRESS,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        return self

    def _wait(self) -> None:
        """Until it listens."""
        end = time.monotonic() + START_SECONDS
        while "LISTEN" not in self._lab.run("farm", "ss", "-Hltn", "sport = :44818").stdout:
            if self._opener.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"{self.program} does not listen on port 44818")
            # a foreign program says nothing when it begins to listen
            time.sleep(0.05)

    def answers(self, sequence: list[Sent]) -> list[bytes | str]:
        self._talk.stdin.write(json.dumps([(one.octets.hex(), one.live) for one in sequence]) + "\n")
        self._talk.stdin.flush()
        line = self._talk.stdout.readline()
        if not line:
            raise RuntimeError("the other implementation has ended")
        return [one if one in {"closed", "no end", "silence"} else bytes.fromhex(one) for one in json.loads(line)]

    def told(self) -> str:
        """What else there is to say of it at the end."""
        return ""

    def __exit__(self, *_: object) -> None:
        self._talk.stdin.close()
        self._talk.wait(10)
        self._talk.stdout.close()
        self._opener.terminate()
        self._opener.wait(10)
        self._lab.close()
        self._folder.cleanup()


def compared(
    sequence: list[Sent], mine: list[bytes | str], theirs: list[bytes | str]
) -> Iterator[tuple[Sent, str, str]]:
    """Each message with both classes of answer, up to the first that differs: from there on the ends are not alike."""
    for sent, one, other in zip(sequence, mine, theirs, strict=False):
        classes = [text if isinstance(text, str) else answer_class(text) for text in (one, other)]
        yield sent, *classes
        if classes[0] != classes[1] and {"closed", "no end"} & set(classes):
            return
