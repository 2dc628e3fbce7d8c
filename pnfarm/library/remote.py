"""A farm that runs in another process, by its API: the same names as :class:`pnfarm.Farm`.

Readings are those of the last :meth:`RemoteDrive.refresh`.  Conditions are watched by the farm itself, so that what
lasted only a moment counts here too.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

import anyio
from prometheus_client.parser import text_string_to_metric_families

from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.drives.telegrams.signal_view import SignalForm, Word
from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.errors import ConfigError, EnvironmentError_, PnfarmError
from pnfarm.farm.injection_fields import fields_of
from pnfarm.farm.views.readings import FaultReading
from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.faults.effects.evidence import Evidence
from pnfarm.library.arguments import duration_ns
from pnfarm.library.events import FarmEvent
from pnfarm.library.face import FarmFace, first_drives
from pnfarm.library.fault import Bound, FaultHandle, FaultView
from pnfarm.library.metrics import Metrics
from pnfarm.library.reading import Reading
from pnfarm.library.remote_device import RemoteDevice
from pnfarm.library.result import ScenarioResult
from pnfarm.table.signals import STW1, ZSW1
from pnfarm.terminal.client import FarmClient
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.yaml_lines import MAX_OCTETS

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Mapping, Sequence

__all__ = ["RemoteDrive", "RemoteFarm"]

_T = TypeVar("_T")
#: Between two questions of a wait.
ASK_SECONDS = 0.02
#: Of a scenario at work: where it is, without its cases.
PROGRESS = {"cases_from": 1_000_000}


class RemoteFarm(FarmFace["RemoteDrive", RemoteDevice]):
    """``async with`` connects; at its end the faults that were injected here, and are still in force, are cleared."""

    def __init__(self, url: str, *, token: str | None = None, tls_ca: str | Path | None = None) -> None:
        super().__init__()
        self.url = url
        self._client = FarmClient(url, token, tls_ca, option=None)
        self._faults: dict[str, _RemoteFault] = {}

    async def ask(self, method: Callable[..., Any], *path: str, **options: Any) -> Any:
        """One request, in a thread; the client gives up after 10 s."""
        return await asyncio.to_thread(method, *path, **options)

    @property
    def client(self) -> FarmClient:
        """The API's client."""
        return self._client

    # -- start and end

    async def open(self) -> None:
        """Connect.  Raises :class:`~pnfarm.errors.EnvironmentError_` where no farm answers."""
        try:
            for view in (await self.ask(self._client.get, "devices"))["devices"]:
                self._devices[view["name"]] = RemoteDevice(self, view)
            await self.refresh()
        except BaseException:
            with self._client:
                raise

    async def close(self) -> None:
        """Clear what was injected here, and disconnect; the farm runs on."""
        failed: list[PnfarmError] = []
        with anyio.CancelScope(shield=True):
            try:
                # of those that have ended the farm forgets the oldest
                own = {**self._faults}
                listed = (await self.ask(self._client.get, "faults"))["faults"] if own else ()
                for fault in (own[view["id"]] for view in listed if view["id"] in own):
                    try:
                        await fault.clear()
                    except PnfarmError as exc:
                        failed.append(exc)
                if failed:
                    raise failed[0]
            finally:
                with self._client:
                    self._faults.clear()

    # -- drives and time

    async def refresh(self) -> Self:
        """Read every drive and every device."""
        found = await self.ask(self._client.get, "drives")
        for view in found["drives"]:
            self._drives.setdefault(view["name"], RemoteDrive(self, view)).view = view
        for device in self.devices:
            await device.refresh()
        return self

    def drive(self, name: str) -> RemoteDrive:
        """A drive by its name in the farm file.  Raises :class:`ConfigError`."""
        if name not in self._drives:
            known = ", ".join(self._drives) or "none, before `async with`"
            raise ConfigError(f"there is no drive {name!r} in the farm at {self.url}; there are {known}")
        return self._drives[name]

    def device(self, name: str) -> RemoteDevice:
        """A device by its name in the farm file.  Raises :class:`ConfigError`."""
        if name not in self._devices:
            known = ", ".join(self._devices) or "none"
            raise ConfigError(f"there is no device {name!r} in the farm at {self.url}; there are {known}")
        return self._devices[name]

    async def run(self, seconds: float | str) -> None:
        """Let time pass."""
        await anyio.sleep(duration_ns(seconds, "seconds") / 1e9)

    async def wait_until(self, holds: Callable[[], object], within: float | str, *, what: str = "it") -> float:
        """Until ``holds()`` is true; the drives are read every 20 ms.  How long it took, s; raises NotInTime."""
        within_ns = duration_ns(within, "within")
        began = asyncio.get_running_loop().time()
        while True:
            await self.refresh()
            took = asyncio.get_running_loop().time() - began
            if holds():
                return require_in_time(what, took * 1e9, within_ns)
            if took * 1e9 >= within_ns:
                raise NotInTime(f"{what} did not hold within {within_ns / 1e9:g} s: {first_drives(self.drives)}")
            await anyio.sleep(ASK_SECONDS)

    # -- faults and scenarios

    def fault(self, kind: str, on: str | Sequence[str] = "all", **options: Any) -> FaultHandle:
        """As :meth:`pnfarm.Farm.fault`."""

        async def begin() -> _RemoteFault:
            body = fields_of(kind, on, options)
            found = _RemoteFault(self, await self._begin("faults", body))
            self._faults[found.view.id] = found
            return found

        return FaultHandle(begin)

    def forget(self, fault_id: str) -> None:
        """A fault of this client has ended."""
        self._faults.pop(fault_id, None)

    async def reset(self) -> list[str]:
        """End every injected fault of the farm, also those of other clients; the ids of those that ended."""
        found = await self.ask(self._client.post, "reset")
        self._faults.clear()
        return list(found["cleared"])

    async def run_scenario(self, path: str | Path) -> ScenarioResult:
        """Run a scenario on the farm.  A cancellation ends it, and its faults."""
        path = Path(path)
        try:
            text = read_regular(path, MAX_OCTETS).decode()
        except (OSError, UnicodeError) as exc:
            raise ConfigError(f"{path} cannot be read: {getattr(exc, 'strerror', None) or exc}") from exc
        return await self.run_text(text)

    async def run_text(self, text: str, *, part: bool = False) -> ScenarioResult:
        """As :meth:`run_scenario`, from the file's text; ``part``: of the caller's own, without traces."""
        begun = await self._begin("scenarios", {"text": text, "part": part})
        try:
            while True:
                progress = await self.ask(self._client.get, "scenarios", begun["id"], query=PROGRESS)
                if progress["state"] == "ended":
                    # a whole record may be large: it is asked for once
                    return ScenarioResult(await self.ask(self._client.get, "scenarios", begun["id"]))
                await anyio.sleep(ASK_SECONDS)
        except BaseException:
            with anyio.CancelScope(shield=True), suppress(PnfarmError):
                await self.ask(self._client.delete, "scenarios", begun["id"])
            raise

    async def _begin(self, what: str, body: Mapping[str, Any]) -> Any:
        """Post to ``what``; a cancellation waits for the answer and deletes what the farm has begun by then."""
        asked = asyncio.ensure_future(self.ask(self._client.post, what, body=body))
        try:
            return await asyncio.shield(asked)
        except asyncio.CancelledError:
            with anyio.CancelScope(shield=True), suppress(PnfarmError):
                await self.ask(self._client.delete, what, (await asked)["id"])
            raise

    # -- what happened

    async def events(self, drive: str | None = None, *, follow: bool = True) -> AsyncIterator[FarmEvent]:
        """What happened, oldest first, then what happens until it is left; the farm is asked every 20 ms."""
        last = "0"
        while True:
            asked = self._client.entries(drive, follow=False, after=last)
            entries = await asyncio.to_thread(lambda asked=asked: list(asked))  # type: ignore[misc]  # mypy does not type the default
            for position, entry in entries:
                if "sequence" in entry:
                    # a hub reads all of its log for the position of several runs, each time
                    last = position if "." not in position else str(entry["sequence"])
                    yield FarmEvent.of(entry)
            if not follow:
                return
            await anyio.sleep(ASK_SECONDS)

    async def metrics(self) -> Metrics:
        """Every metric as it is now."""
        text = await asyncio.to_thread(self._client.metrics)
        return Metrics(text_string_to_metric_families(text))

    def __repr__(self) -> str:
        return f"<RemoteFarm {self.url}: {first_drives(self.drives) or 'not connected'}>"


class RemoteDrive:
    """A drive: readings are those of the last :meth:`refresh`."""

    def __init__(self, farm: RemoteFarm, view: Mapping[str, Any]) -> None:
        self._farm = farm
        #: As ``GET drives/{name}`` gave it.
        self.view = view
        self._model = model_by_name(view["model"])

    async def refresh(self) -> Self:
        """Read it again."""
        self.view = await self._farm.ask(self._farm.client.get, "drives", self.name)
        return self

    def read(self, reading: Callable[[Mapping[str, Any]], _T]) -> _T:
        """A reading of the last view."""
        return reading(self.view)

    name = Reading(lambda view: str(view["name"]))
    model = Reading(lambda view: str(view["model"]))
    state = Reading(lambda view: str(view["state"]))
    connected = Reading(lambda view: bool(view["connected"]))
    setpoint = Reading(lambda view: float(view["setpoint_rpm"]))
    velocity = Reading(lambda view: float(view["velocity_rpm"]))
    position = Reading(lambda view: float(view["position_revolutions"]))
    current = Reading(lambda view: float(view["current_amperes"]))
    torque = Reading(lambda view: float(view["torque_newton_metres"]))
    following_error = Reading(lambda view: float(view["following_error_revolutions"]))

    def snapshot(self) -> dict[str, Any]:
        """Everything at once."""
        return dict(self.view)

    @property
    def faults(self) -> list[FaultReading]:
        """The active ones, the first one first."""
        return [self._fault(found) for found in self.view["faults"]]

    @property
    def active_fault(self) -> FaultReading | None:
        """The active one; None without."""
        return next(iter(self.faults), None)

    @property
    def last_fault(self) -> FaultReading | None:
        """The active one, or the one that was acknowledged last."""
        found = self.view["last_fault"]
        return None if found is None else self._fault(found)

    @property
    def warning(self) -> FaultReading | None:
        found = self.view["warning"]
        return None if found is None else self._fault(found)

    @property
    def stw1(self) -> Word:
        """The control word that the drive obeys, with its bits by name."""
        return self._word("STW1", STW1, STW1_BITS)

    @property
    def zsw1(self) -> Word:
        """The status word, with its bits by name."""
        return self._word("ZSW1", ZSW1, ZSW1_BITS)

    def fault(self, kind: str, **options: Any) -> FaultHandle:
        """As :meth:`pnfarm.library.Drive.fault`."""
        return self._farm.fault(kind, self.name, **options)

    async def wait_for(self, condition: str, within: float | str) -> float:
        """As :meth:`pnfarm.library.Drive.wait_for`; the farm watches the condition."""
        within_ns = duration_ns(within, "within")
        step = {"drive": self.name, "that": condition, "within": format_duration(max(1, within_ns))}
        # JSON is YAML
        result = await self._farm.run_text(json.dumps({"scenario": "wait", "steps": [{"expect": step}]}), part=True)
        (case,) = result.cases
        await self.refresh()
        if case["verdict"] != "passed":
            raise NotInTime(f"{condition} did not hold within {within_ns / 1e9:g} s: {case['message']}; {self!r}")
        return float(case["held_after_seconds"].get(self.name, 0.0))

    async def parameter(self, name: str | int) -> int:
        """A parameter by number or by the manual's name."""
        found = await self._farm.ask(self._farm.client.get, "drives", self.name, "params", str(name))
        return int(found["value"])

    async def set_parameter(self, name: str | int, value: int) -> None:
        """Write a parameter; raises the drive's error."""
        path = ("drives", self.name, "params", str(name))
        await self._farm.ask(self._farm.client.put, *path, body={"value": value})

    async def power_cycle(self) -> None:
        """Off and on."""
        self.view = await self._farm.ask(self._farm.client.post, "drives", self.name, "power-cycle")

    def _fault(self, found: Mapping[str, Any]) -> FaultReading:
        return FaultReading(self._model, found["number"], found["name"])

    def _word(self, name: str, slot: int, usual: tuple[str, ...]) -> Word:
        names = self._model.profidrive.bit_names(name, self.view["telegram"]) or usual
        form = SignalForm(name.lower(), slot, 16, False, 0.0, "", names)
        return Word(int(self.view[name.lower()], 16), form)

    def __repr__(self) -> str:
        fault = f", fault {self.active_fault}" if self.active_fault is not None else ""
        link = "connected" if self.connected else "not connected"
        return f"<RemoteDrive {self.name} {self.state}, {link}{fault}, {self.velocity:.1f} rpm, STW1 {self.stw1!r}>"


class _RemoteFault(Bound):
    def __init__(self, farm: RemoteFarm, found: Mapping[str, Any]) -> None:
        self._farm = farm
        self._found = found

    @property
    def view(self) -> FaultView:
        found = self._found
        evidence = Evidence.from_dict(found["evidence"])
        return FaultView(found["id"], found["kind"], tuple(found["drives"]), found["state"], evidence)

    async def refresh(self) -> None:
        self._found = await self._farm.ask(self._farm.client.get, "faults", self._found["id"])

    async def clear(self) -> None:
        await self.refresh()
        if self.view.state != "ended":
            try:
                self._found = await self._farm.ask(self._farm.client.delete, "faults", self._found["id"])
            except ConfigError:
                # it may have ended between the two questions
                await self.refresh()
                if self.view.state != "ended":
                    raise
        if left := self._found.get("unreachable"):
            where = f"{', '.join(left)}, whose shard does not answer"
            raise EnvironmentError_(f"{self._found['id']} is in force on {where}: clear it again when it does")
        self._farm.forget(self._found["id"])
