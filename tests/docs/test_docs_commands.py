"""What the pages show: their commands print it, their files are right, their links lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from pnfarm.cli.main import main
from pnfarm.farm.file.reading import parse_farm

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "notes" not in path.parts)
#: Pages beside the documentation that link to it.
OTHERS = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")]
FENCE = re.compile(r'^```(\w*)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]*)?\)")
END = "-- end --"


class Block(NamedTuple):
    language: str
    title: str | None
    text: str


def blocks(page: Path) -> Iterator[Block]:
    for found in FENCE.finditer(page.read_text("utf-8")):
        yield Block(found[1], found[2], found[3])


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


# -- commands --------------------------------------------------------------------------------------------------------


def told(text: str) -> list[tuple[str, list[str]]]:
    """Commands of a console block, each with the lines that are shown behind it."""
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def fits(shown: list[str], printed: list[str]) -> bool:
    """Whether what is shown is what was printed, with ``...`` for any lines."""
    if not shown:
        return not printed
    if shown[0] == "...":
        return any(fits(shown[1:], printed[skipped:]) for skipped in range(len(printed) + 1))
    return bool(printed) and shown[0] == printed[0] and fits(shown[1:], printed[1:])


@pytest.fixture
def shell(tmp_path):
    """Runs commands of a shell, in an empty folder with ``pnfarm`` and the project's ``configs``."""
    tools = tmp_path / "bin"
    tools.mkdir()
    program = tools / "pnfarm"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pnfarm.cli.main "$@"\n', "ascii")
    program.chmod(0o755)
    place = tmp_path / "work"
    place.mkdir()
    (place / "configs").symlink_to(ROOT / "configs")
    running = subprocess.Popen(
        ["bash", "--norc"], cwd=place, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert running.stdin is not None
    assert running.stdout is not None
    running.stdin.write(f'PATH="{tools}:$PATH"\n')

    def run(command: str) -> list[str]:
        # the command's code is kept for the next one, which may ask for it
        running.stdin.write(f"{command}\n{{ kept=$?; echo '{END}'; (exit $kept); }}\n")
        running.stdin.flush()
        lines = []
        for line in running.stdout:
            if line.rstrip("\n").endswith(END):
                return lines
            lines.append(line.rstrip())
        raise AssertionError(f"the shell ended in {command!r}: {lines}")

    run.place = place
    yield run
    running.communicate(timeout=60)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(block.language == "console" for block in blocks(page))], ids=named
)
def test_every_command_of_a_page_prints_what_the_page_shows(page, shell):
    for block in blocks(page):
        if block.title is not None:
            (shell.place / block.title).write_text(block.text, "utf-8")
        elif block.language == "console":
            for command, shown in told(block.text):
                printed = shell(command)
                assert fits(shown, printed), "\n".join([f"$ {command}", *printed])


def test_the_tutorial_leads_to_a_red_verdict_and_then_to_a_green_one():
    codes = [
        shown
        for block in blocks(DOCS / "tutorial.md")
        if block.language == "console"
        for command, shown in told(block.text)
        if command == "echo $?"
    ]
    assert codes == [["1"], ["0"]]


# -- files -----------------------------------------------------------------------------------------------------------


def steps(page: Path) -> list[str]:
    """Blocks of YAML that are steps of a scenario."""
    return [block.text for block in blocks(page) if block.language == "yaml" and block.text.startswith("- ")]


def test_every_pattern_of_the_cookbook_is_right_in_a_scenario(tmp_path):
    patterns = steps(DOCS / "cookbook.md")
    assert len(patterns) > 8
    farm = ROOT / "configs" / "scenarios" / "line.pnfarm.yml"
    for place, text in enumerate(patterns):
        # as text: `on` would be a truth value to a plain reader of YAML
        head = f"scenario: pattern-{place}\nfarm: {farm}\nsteps:\n"
        file = tmp_path / f"{place}.scenario.yml"
        file.write_text(head + textwrap.indent(text, "  "), "utf-8")
        assert main(["validate", str(file)]) == 0, text


def device_examples() -> list[str]:
    """The examples of devices whose description files are in ``configs``, each as a farm file."""
    indented = re.findall(r"^    devices:\n(?:(?:     .*)?\n)+", (DOCS / "devices.md").read_text("utf-8"), re.MULTILINE)
    texts = [textwrap.dedent(text) for text in indented if "Example-" in text or "EXMP" in text]
    return [f"farm: example\nlink: {{kind: memory}}\n{text}" for text in texts]


def test_every_example_of_devices_is_a_right_farm_file():
    examples = device_examples()
    assert len(examples) == 3
    for text in examples:
        parse_farm(text, path=ROOT / "configs" / "example.pnfarm.yml")


def recovery_by_cycle() -> str:
    """The example of a scenario with a matrix."""
    text = (DOCS / "scenarios.md").read_text("utf-8")
    return textwrap.dedent(text[text.index("    scenario: recovery-by-cycle") :].split("\n\n")[0])


def test_the_example_with_a_matrix_runs_on_the_line_of_the_library(tmp_path):
    file = tmp_path / "matrix.scenario.yml"
    file.write_text(recovery_by_cycle(), "utf-8")
    assert main(["run", str(file), "--virtual", "--farm", str(LINE)]) == 0


LINE = ROOT / "configs" / "scenarios" / "line.pnfarm.yml"
NEVER = f"controller.program: {{python: {ROOT / 'configs' / 'programs' / 'never_acknowledges.py'}}}"


def returning(tmp_path: Path) -> Iterator[Path]:
    """The examples that expect an axis back, as scenarios with a program that never acknowledges."""
    pattern = next(text for text in steps(DOCS / "cookbook.md") if "it comes back" in text)
    wait = "- wait: {until: state == S4, within: 20s}\n"
    file = tmp_path / "pattern.scenario.yml"
    head = f"scenario: pattern\nfarm: {LINE}\nwith: {{{NEVER}}}\nsteps:\n"
    file.write_text(head + textwrap.indent(wait + pattern, "  "), "utf-8")
    yield file
    matrix = recovery_by_cycle()
    for old, new in (("line.pnfarm.yml", str(LINE)), ("[16ms, 32ms]", "[16ms]"), ("$cycle}", f"$cycle, {NEVER}}}")):
        assert old in matrix
        matrix = matrix.replace(old, new)
    file = tmp_path / "matrix.scenario.yml"
    file.write_text(matrix, "utf-8")
    yield file


def test_an_example_that_expects_an_axis_back_fails_for_a_program_that_never_brings_it_back(tmp_path):
    for file in returning(tmp_path):
        assert main(["run", str(file), "--virtual"]) == 1, file


# -- links -----------------------------------------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings."""
    found: set[str] = set()
    fenced = False
    for line in page.read_text("utf-8").splitlines():
        if line.startswith("```"):
            fenced = not fenced
        elif not fenced and (heading := re.match(r"#+ (.*)", line)):
            plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).lower()
            name = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
            taken = sum(one == name or re.fullmatch(rf"{re.escape(name)}-\d+", one) is not None for one in found)
            found.add(f"{name}-{taken}" if taken else name)
    return found


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=named)
def test_every_link_of_a_page_leads_to_a_file_and_an_anchor_that_exist(page):
    text = re.sub(r"`[^`\n]*`", "", FENCE.sub("", page.read_text("utf-8")))
    missing = []
    for link, anchor in LINK.findall(text):
        if "://" in link or link.startswith("mailto:"):
            continue
        target = (page.parent / link).resolve() if link else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor[1:] not in anchors(target)):
            missing.append(link + anchor)
    assert missing == []
