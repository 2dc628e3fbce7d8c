"""The report of ``pnfarm verify``: its JSON, and the schema of it, which is made of these classes."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "EXIT_CODES",
    "Answer",
    "Check",
    "CycleFigures",
    "Fault",
    "Finding",
    "Host",
    "Limits",
    "Package",
    "Part",
    "Report",
    "Verdict",
    "Versions",
    "report_schema",
    "worst",
]


class Verdict(StrEnum):
    """``not run``: an earlier step ended the part; of a check only."""

    PASSED = "passed"
    FAILED = "failed"
    INCONCLUSIVE = "inconclusive"
    NOT_RUN = "not run"


EXIT_CODES = {Verdict.PASSED: 0, Verdict.FAILED: 1, Verdict.INCONCLUSIVE: 3}


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Of checks or parts: a failure outweighs what is inconclusive, which outweighs what passed."""
    found = set(verdicts)
    if Verdict.FAILED in found:
        return Verdict.FAILED
    return Verdict.INCONCLUSIVE if found & {Verdict.INCONCLUSIVE, Verdict.NOT_RUN} else Verdict.PASSED


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Check(_Entry):
    """One expectation of the scenario."""

    name: str = Field(description="Class of the fault, and what is expected of the drive.")
    line: int = Field(description="Line of the scenario.")
    expected: str = Field(description="Condition or metric of the scenario, and when it must hold.")
    observed: str = Field(description="What was measured; of one that did not pass, with the values of the drives.")
    verdict: Verdict = Field(description="passed, failed (a difference), inconclusive (the farm was late), not run.")


class Fault(_Entry):
    """A fault that was injected."""

    kind: str = Field(description="As `pnfarm fault kinds` lists it.")
    drives: list[str] = Field(description="On which drives and devices.")
    seed: int | None = Field(description="Of its random numbers, null where none is given.")
    confirmed: bool = Field(description="Whether what it did was seen: on the wire, of the drive or of the link.")


class Part(_Entry):
    """The known farm at one place."""

    name: Literal["memory", "wire"] = Field(description="In memory in virtual time; over a veth pair in real time.")
    scenario: str = Field(description="Scenario and farm file in the folder pnfarm/cli/verify/known of the package.")
    verdict: Verdict = Field(description="The worst of its checks.")
    seconds: float = Field(description="Length of the run in the farm's time.")
    runs: int = Field(description="How often it ran: it is repeated while it is inconclusive.")
    late_seconds: float | None = Field(description="How late the farm itself was at most; null in virtual time.")
    stalls: int | None = Field(description="Ticks so late that a cycle was left out; null in virtual time.")
    checks: list[Check]
    faults: list[Fault]


class CycleFigures(_Entry):
    """Drives with one cycle, measured on a veth pair beside a loop that only sends and receives (the floor)."""

    cycle_seconds: float
    drives: int
    seconds: float = Field(description="Length of the measurement.")
    lateness_p50_seconds: float = Field(description="How late ticks begin: half of them are no later.")
    lateness_p99_seconds: float = Field(description="The same of 99 of 100.")
    lateness_max_seconds: float = Field(description="Upper end of the histogram's last bucket with a tick.")
    floor_p99_seconds: float = Field(description="p99 of the floor.")
    stalls: int = Field(description="Ticks so late that a cycle was left out.")
    lost_connections: int
    others_cores: float = Field(description="Cores that other processes, or the hypervisor, used meanwhile.")
    held: bool = Field(description="No connection was lost, and p99 is at most half a cycle.")


class Limits(_Entry):
    """What this machine can do; no verdict depends on it."""

    shortest_cycle_seconds: float | None = Field(description="The shortest measured cycle that is held; null if none.")
    cycles: list[CycleFigures]
    frame_seconds: float | None = Field(description="CPU of one cyclic frame on a veth pair; null if not measured.")
    step_seconds: float | None = Field(description="CPU of one firmware step of a drive.")
    drives_at_1_ms: int | None = Field(
        description="An estimate: drives with 1 ms that take 0.6 of a processor, with two frames and a step a cycle."
    )


class Versions(_Entry):
    """Of programs."""

    pnfarm: str
    python: str
    numba: str
    numpy: str


class Package(_Entry):
    """The files of the package."""

    sha256: str = Field(
        description="SHA-256 of the lines that sha256sum writes for all files but __pycache__ and machine_code, "
        "sorted by path."
    )
    files: int


class Host(_Entry):
    """The machine."""

    processor: str
    cores: int = Field(description="Processors of the machine.")
    usable_cores: int = Field(description="Processors that this process may use.")
    architecture: str
    kernel: str
    virtualisation: str = Field(description="As systemd-detect-virt says, or what the processor shows; else unknown.")


class Finding(_Entry):
    """A check of `pnfarm doctor`."""

    name: str
    ok: bool | None = Field(description="false: missing; null: a note.")
    detail: str


class Answer(_Entry):
    """What a process with a network of its own found; ``left_out`` says what was not measured, and why.

    ``ended``: its part came to an end, or is not possible on this machine.
    """

    part: Part | None = None
    ended: bool = True
    cycles: list[CycleFigures] = []
    left_out: list[str] = []


class Report(_Entry):
    """What `pnfarm verify --json` writes."""

    report: Literal["pnfarm verify"] = "pnfarm verify"
    version: Annotated[Literal[1], Field(description="Of this schema.")] = 1
    date: str = Field(description="Begin, ISO 8601, UTC.")
    verdict: Verdict = Field(
        description="passed, failed or inconclusive: the worst part; inconclusive also if the wire's did not end."
    )
    versions: Versions
    package: Package
    host: Host
    compiled: bool = Field(description="Whether the engine is compiled; with NUMBA_DISABLE_JIT=1 it is not.")
    seeds: list[int] = Field(description="Seeds of random numbers of the scenarios.")
    parts: list[Part]
    limits: Limits | None = Field(description="null where they were not measured.")
    left_out: list[str] = Field(description="What was not done, and why.")
    machine: list[Finding] = Field(description="As `pnfarm doctor` reports; no verdict depends on it.")


def report_schema() -> dict[str, Any]:
    """JSON Schema of the report, draft 2020-12."""
    schema = Report.model_json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "pnfarm verify report"}
