"""Hardware of SIMATIC AX (``*.hwl.yml``, ``*.hwl.yaml``, ``*.hwl.json``): devices, IO systems, and templates of both.

The language is Siemens' and its reference is not public: what is here is what its public examples use.  Several files
are one configuration, and a template may be in another file than the device that applies it.  The result has the form
of CAx data (:mod:`pnfarm.buses.projects.caex`), so that the buses read one kind of project.

Files are not trusted: octets, devices, parts and the depth of templates within templates are bounded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from ipaddress import AddressValueError, IPv4Interface, NetmaskValueError
from typing import TYPE_CHECKING, Any

from pnfarm.buses.projects.caex import CaexElement, CaexProject
from pnfarm.buses.projects.parts import WATCHDOG_FACTOR
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.yaml_lines import YamlError, parse_yaml

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["MAX_FILES", "SUFFIXES", "NotHwlError", "parse_hwl"]

SUFFIXES = (".hwl.yml", ".hwl.yaml", ".hwl.json")
MAX_FILES = 2000
#: Devices, modules and submodules of a configuration, and templates within templates.
MAX_PARTS, MAX_TEMPLATES = 20_000, 10
#: Longest text that is kept, characters.
MAX_TEXT = 1024
_KINDS = ("Devices", "Modules", "Submodules")
_PLACEHOLDER = re.compile(r"\$\{([^{}]{1,100})\}")
#: A comment of the JSON files, or a text with two slashes in it.
_COMMENT = re.compile(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*')
_ROLES = "AutomationProjectConfigurationRoleClassLib"


class NotHwlError(ConfigError):
    """What should be hardware of SIMATIC AX is something else, or too large."""


@dataclass(frozen=True, slots=True)
class _Item:
    """A mapping of a file, with the values of the placeholders around it."""

    values: Mapping[str, Any]
    arguments: Mapping[str, Any]

    def text(self, key: str) -> str:
        """A value as text, with the placeholders replaced; empty for none."""
        return self.filled(self.values.get(key, ""))

    def filled(self, value: Any) -> str:
        given = "" if value is None or isinstance(value, dict | list) else str(value)
        return _PLACEHOLDER.sub(lambda one: str(self.arguments.get(one[1], one[0]))[:MAX_TEXT], given)[:MAX_TEXT]

    def inside(self, key: str) -> _Item:
        """The mapping under a key."""
        return _Item(_mapping(self.values.get(key)), self.arguments)

    def each(self, key: str) -> Iterator[_Item]:
        """The mappings of a list."""
        for one in _listed(self.values.get(key)):
            yield _Item(_mapping(one), self.arguments)


def _mapping(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def parse_hwl(files: Mapping[str, bytes]) -> CaexProject:
    """The configuration in these files, by name.

    Raises :class:`NotHwlError` for one that is none or too large, or that applies a template which is in none of them.
    """
    roots = [_root(name, data) for name, data in sorted(files.items())]
    if not any(key in root for root in roots for key in ("Devices", "IoSystems", "Templates")):
        raise NotHwlError("there are neither Devices nor Templates in it")
    return _Builder(roots).project()


def _root(name: str, data: bytes) -> dict[str, Any]:
    try:
        text: bytes | str = data
        if name.lower().endswith(".json"):
            text = _COMMENT.sub(lambda one: one[1] or "", data.decode("utf-8-sig"))
        return _mapping(parse_yaml(text).root.plain())
    except UnicodeDecodeError as exc:
        raise NotHwlError(f"{name} is no UTF-8") from exc
    except YamlError as exc:
        problem = exc.problem
        raise NotHwlError(f"{name}, line {problem.line}: {problem.what}") from exc


class _Builder:
    """Makes the elements of CAx data."""

    def __init__(self, roots: list[dict[str, Any]]) -> None:
        self._roots = [_Item(root, {}) for root in roots]
        self._templates = {
            kind: {one.text("Name"): one for root in self._roots for one in root.inside("Templates").each(kind)}
            for kind in _KINDS
        }
        self._root = CaexElement("")
        self._interfaces: dict[str, CaexElement] = {}
        self._count = 0

    def project(self) -> CaexProject:
        for root in self._roots:
            for device in self._applied("Devices", root):
                self._device(device)
        links = [link for root in self._roots for system in root.each("IoSystems") for link in self._system(system)]
        return CaexProject(self._root, tuple(links))

    def _applied(self, kind: str, holder: _Item) -> Iterator[_Item]:
        """The items of a list, and the contents of the templates that it applies."""
        for item in holder.each(kind):
            yield from self._one(kind, item)

    def _one(self, kind: str, item: _Item, depth: int = 0) -> Iterator[_Item]:
        self._count += 1
        if self._count > MAX_PARTS:
            raise NotHwlError(f"there are more than {MAX_PARTS} devices and parts")
        if "Apply" not in item.values:
            yield item
            return
        if depth >= MAX_TEMPLATES:
            raise NotHwlError(f"templates are deeper than {MAX_TEMPLATES}")
        given = item.inside("Apply") if isinstance(item.values["Apply"], dict) else item
        name = given.text("TemplateName") or given.text("Apply")
        template = self._templates[kind].get(name)
        if template is None:
            raise NotHwlError(f"the template {name!r} is in none of its files: name the folder that has all of them")
        usual = {one.text("Name"): one.values.get("Value", "") for one in template.each("Placeholders")}
        arguments = {key: given.filled(value) for key, value in _mapping(given.values.get("Arguments")).items()}
        content = _Item(_mapping(template.values.get("Content")), {**usual, **arguments})
        yield from self._one(kind, content, depth + 1)

    def _device(self, item: _Item) -> None:
        device = self._element(self._root, item.text("Name"), "Device")
        slot = -1
        for module in self._applied("Modules", item):
            slot = _place(module, slot + 1)
            made = self._part(device, module, slot, "DAP" if slot == 0 else "M")
            if slot == 0:
                device.attributes["TypeIdentifier"] = re.sub(r"/DAP/.*", "/D", made.attributes["TypeIdentifier"])
                made.attributes["DeviceItemType"] = "HeadModule"
            for interface in module.each("Interfaces"):
                self._interface(made, interface, f"{device.name}/{made.name}/{interface.text('Name')}")
            subslot = 0
            for submodule in self._applied("Submodules", module):
                subslot = _place(submodule, subslot + 1)
                # subslots count from 1, and places in CAx data from 0
                self._part(made, submodule, subslot - 1, "SM")

    def _part(self, holder: CaexElement, item: _Item, place: int, kind: str) -> CaexElement:
        part = self._element(holder, item.text("Name"), "DeviceItem")
        part.attributes["PositionNumber"] = str(place)
        own = item.inside("TypeIdentifier")
        if file := own.text("FileName"):
            part.attributes["TypeIdentifier"] = f"GSD:{file}/{kind}/{own.text('GsdId')}"
        elif number := own.text("OrderNumber"):
            part.attributes["TypeIdentifier"] = f"OrderNumber:{number}/{own.text('Version')}"
        else:
            # a slot that is to be empty
            part.attributes["TypeIdentifier"] = ""
        return part

    def _interface(self, module: CaexElement, item: _Item, path: str) -> None:
        interface = self._element(module, item.text("Name"), "CommunicationInterface")
        self._interfaces[path] = interface
        node = self._element(interface, "IE1", "Node")
        node.attributes["Type"] = "Ethernet"
        for one in item.inside("Addresses").each("Configured"):
            if name := one.text("ProfinetDeviceName"):
                node.attributes["ProfinetDeviceName"] = name
            try:
                address = IPv4Interface(one.text("IPv4"))
            except (AddressValueError, NetmaskValueError):
                continue
            # without a prefix /24 is assumed
            network = address.network if "/" in one.text("IPv4") else IPv4Interface(f"{address.ip}/24").network
            node.attributes |= {"NetworkAddress": str(address.ip), "SubnetMask": str(network.netmask)}

    def _system(self, item: _Item) -> Iterator[tuple[str, str]]:
        """The IO system in its controller's interface, and the links of the devices to it."""
        controllers = [self._interfaces.get(one.text("Ref")) for one in item.each("ControllerInterfaces")]
        holder = next((one for one in controllers if one is not None), None)
        if holder is None:
            return
        system = self._element(holder, item.text("Name"), "IoSystem")
        for one in item.each("DeviceInterfaces"):
            if (interface := self._interfaces.get(one.text("Ref"))) is not None:
                if factor := one.inside("Parameters").text(WATCHDOG_FACTOR):
                    interface.attributes[WATCHDOG_FACTOR] = factor
                yield f"{interface.id}:Interface", f"{system.id}:IoSystem"

    def _element(self, holder: CaexElement, name: str, role: str) -> CaexElement:
        self._count += 1
        element = CaexElement(name, f"e{self._count}", roles=[f"{_ROLES}/{role}"], parent=holder)
        holder.children.append(element)
        return element


def _place(item: _Item, otherwise: int) -> int:
    """The slot or subslot that an item names."""
    given = (item.text("Slot"), item.text("Position"))
    return next((int(one) for one in given if one.isascii() and one.isdigit() and len(one) < 6), otherwise)
