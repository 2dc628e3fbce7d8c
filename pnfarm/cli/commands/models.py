"""``pnfarm models``: lists the drive models, or shows one in full with the source of each value."""

from __future__ import annotations

from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.cli.completion import complete_model
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_json, print_line, print_section, print_table
from pnfarm.terminal.settings import Format, FormatOption

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.description.model import Model

__all__ = ["models"]

#: Sections whose values each have a source of their own.
_FACTS = (
    "motor", "firmware", "position_units", "factor_group", "control_limits", "communication_loss", "sign_of_life",
    "following_error", "motion_tasks", "effects", "numbering", "parameter_access", "parameter_words", "parameter_texts",
    "address_mode", "lamps", "description_file", "diagnosis", "diagnosis_coding", "realism",
)  # fmt: skip


def models(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="MODEL",
            help="Show one model in full; default: a list of all.",
            show_default=False,
            autocompletion=complete_model,
        ),
    ] = None,
    output: FormatOption = Format.TABLE,
    parameters: Annotated[
        str | None,
        typer.Option(
            metavar="GLOB",
            help="Show only parameters with this name, number or effect, such as 'HOME.*', 2203, kept or '*'.",
            show_default=False,
        ),
    ] = None,
    farm: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Farm file whose `parameter_lists` add parameters to the model.", show_default=False
        ),
    ] = None,
) -> None:
    """List the drive models, or show one with the source of each value."""
    from pnfarm.drives import catalogue
    from pnfarm.drives.description.as_json import as_json

    if model is None:
        if parameters is not None:
            raise ConfigError("--parameters needs a model: pnfarm models MODEL --parameters GLOB")
        if farm is not None:
            raise ConfigError("--farm needs a model: pnfarm models MODEL --farm FILE")
        _list(output)
        return
    found = as_json(catalogue.model(model) if farm is None else _model_in(farm, model))
    if parameters is not None:
        found["parameters"] = [row for row in found["parameters"] if _matches(row, parameters)]
        if not found["parameters"]:
            raise ConfigError(f"{found['name']} has no parameter {parameters!r}; '*' shows all of them")
    if output is Format.JSON:
        print_json(found if parameters is None else found["parameters"])
    elif parameters is not None:
        _print_parameters(found["parameters"])
    else:
        _print(found)


def _model_in(farm: Path, name: str) -> Model:
    """A model with the parameters that a farm file's list adds to it."""
    from pnfarm.cli.farm_file import read
    from pnfarm.drives import catalogue

    plain = catalogue.model(name)
    facts = read(farm).known.model(plain.name)
    return (facts.described if facts is not None else None) or plain


def _matches(row: dict[str, Any], glob: str) -> bool:
    wanted = glob.upper()
    return any(
        fnmatchcase(text.upper(), wanted) for text in (row["name"], row["number"], str(row["pnu"]), row["effect"])
    )


def _print_parameters(rows: list[dict[str, Any]]) -> None:
    columns = (">PNU", "NAME", "TYPE", ">DEFAULT", "UNIT", "SCALE", "ACCESS", "EFFECT", "~SOURCE", "~NOTE")
    keys = ("pnu", "name", "type", "default", "unit", "scale", "access", "effect", "source", "note")
    print_table(columns, [tuple(row[key] for key in keys) for row in rows])


def _list(output: Format) -> None:
    from pnfarm.drives import catalogue

    entries = catalogue.models().values()
    if output is Format.JSON:
        keys = ("name", "title", "maker", "bus", "edition")
        print_json([{**{key: getattr(e, key) for key in keys}, "aliases": list(e.aliases)} for e in entries])
        return
    columns = ("MODEL", "MAKER", "BUS", "~TITLE", "~MANUAL", "~ALSO")
    print_table(columns, [(e.name, e.maker, e.bus, e.title, e.edition, " ".join(e.aliases)) for e in entries])


def _print(found: dict[str, Any]) -> None:
    from pnfarm.drives.parameters.effects import EFFECTS

    print_line(f"{found['name']}: {found['title']} ({found['maker']}, {found['bus']})")
    print_line(f"manual: {found['manual']}, {found['edition']}")
    if found["aliases"]:
        print_line(f"also: {' '.join(found['aliases'])}")
    for section in ("identity", "limits"):
        if found[section] is None:
            continue
        values = dict(found[section])
        sources = values.pop("sources")
        rows = [
            (key.replace("_", " "), _value(key, value), sources[key]["source"], sources[key]["note"])
            for key, value in values.items()
        ]
        print_section((section.upper(), "VALUE", "~SOURCE", "~NOTE"), rows)
    for section in (*_FACTS, "bus_facts"):
        if found.get(section):
            title = found["bus"] if section == "bus_facts" else section
            print_section((title.replace("_", " ").upper(), "VALUE", "~SOURCE", "~NOTE"), _fact_rows(found[section]))
    if found["behaviour"]:
        print_section(("BEHAVIOUR", "READING", "~WHAT THE DRIVE DOES"), list(_reading_rows(found["behaviour"])))
        rows = [(point["name"], point["about"], point["reason"], point["source"]) for point in found["behaviour"]]
        print_section(("BEHAVIOUR", "~LEFT OPEN", "~REASON OF THE DEFAULT", "~SOURCE"), rows)
    if found["behaviour_sets"]:
        sets = [(one["name"], one["title"], one["gaps"]) for one in found["behaviour_sets"]]
        print_section(("SET", "TITLE", "~WHAT NO SOURCE SAYS"), sets)
    for kind, parts in found["motors"].items():
        rows = [row for part, facts in parts.items() for row in _fact_rows(facts, f"{part} ")]
        print_section((f"MOTORS {kind}", "VALUE", "~SOURCE", "~NOTE"), rows)
    if found["telegrams"]:
        _print_telegrams(found)
    if found["supplements"]:
        beside = [
            (
                one["number"],
                f"0x{one['submodule_ident']:08X}",
                one["subslot"],
                _names(one["output"]),
                _names(one["input"]),
            )
            for one in found["supplements"]
        ]
        print_section(("SUPPLEMENTARY", "SUBMODULE", ">SUBSLOT", "~TO THE DRIVE", "~FROM THE DRIVE"), beside)
    print_section(
        (">COUNT", "OF", "~SOURCES"),
        [
            (len(found[section]), section, "; ".join(_sources(found[section])))
            for section in ("parameters", "signals", "bits", "faults")
        ],
    )
    counts = Counter(row["effect"] for row in found["parameters"])
    effects = [(counts[name], name, meaning) for name, meaning in EFFECTS.items()]
    print_section((">PARAMETERS", "EFFECT", "~MEANING"), effects)
    print_line()
    print_line(f"Every parameter: pnfarm models {found['name']} --parameters '*'; every row: --format json")


def _print_telegrams(found: dict[str, Any]) -> None:
    if any(telegram["identifiers"] for telegram in found["telegrams"]):
        print_section(("TELEGRAM", "IDENTIFIERS", ">IN", ">OUT", "~SOURCE"), _identifier_rows(found))
    else:
        columns = ("MODULE", "IDENT", "SUBSLOT", "SUBMODULE", ">IN", ">OUT", "~SOURCE")
        print_section(columns, _module_rows(found))
    print_section(
        ("TELEGRAM", "~TO THE DRIVE", "~FROM THE DRIVE", "SOURCE", "~NOTE"),
        [
            (
                f"{telegram['number']}{' (default)' if telegram['number'] == found['default_telegram'] else ''}",
                "free" if telegram["free_mapping"] else _names(telegram["output"]),
                "free" if telegram["free_mapping"] else _names(telegram["input"]),
                telegram["source"],
                telegram["note"],
            )
            for telegram in found["telegrams"]
        ],
    )


def _names(words: list[str | None]) -> str:
    return " ".join(name or "-" for name in words)


def _fact_rows(facts: dict[str, Any], prefix: str = "") -> list[tuple[str, str, str, str]]:
    return [
        (
            prefix + key.replace("_", " ").replace(".", " "),
            f"{_value(key, fact['value'])} {fact['unit']}".strip(),
            fact["source"],
            fact["note"],
        )
        for key, fact in facts.items()
    ]


def _reading_rows(points: list[dict[str, Any]]) -> Iterator[tuple[str, str, str]]:
    for point in points:
        for place, (name, does) in enumerate(point["descriptions"].items()):
            usual = " (default)" if name == point["default"] else ""
            yield "" if place else point["name"], f"{name}{usual}", does


def _identifier_rows(found: dict[str, Any]) -> Iterator[tuple[object, ...]]:
    """Telegrams that a master configures by identifiers, with their octets of data."""
    for telegram in found["telegrams"]:
        octets = (2 * len(telegram["input"]), 2 * len(telegram["output"]))
        yield telegram["number"], telegram["identifiers"].upper(), *octets, telegram["module_source"]


def _module_rows(found: dict[str, Any]) -> Iterator[tuple[object, ...]]:
    modules = [("head (DAP)", found["dap"])] if found["dap"] is not None else []
    for telegram in found["telegrams"]:
        modules += [(f"telegram {telegram['number']}", module) for module in (telegram, *telegram["other_modules"])]
    for name, module in modules:
        for submodule in module["submodules"]:
            yield (
                name,
                f"0x{module['module_ident']:08X}",
                f"{submodule['slot']}.{submodule['subslot']:X}",
                f"0x{submodule['ident']:08X}",
                submodule["input_bytes"],
                submodule["output_bytes"],
                module["module_source"],
            )


def _sources(rows: list[dict[str, Any]], most: int = 4) -> list[str]:
    """The sources of many rows with their counts, the most frequent first."""
    ranked = Counter(row["source"] for row in rows).most_common()
    shown = [f"{source} ({count})" for source, count in ranked[:most]]
    return [*shown, f"and {len(ranked) - most} more"] if len(ranked) > most else shown


def _value(key: str, value: Any) -> str:
    if isinstance(value, int) and not isinstance(value, bool) and key.endswith(("_id", "ident")):
        return f"0x{value:04X}"
    if isinstance(value, list):
        return " ".join(map(str, value))
    return str(value)
