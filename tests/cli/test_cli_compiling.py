"""The first start: progress of the compilation is reported, and the demo times itself from its end."""

import sys
from functools import partial

import anyio
import pytest
import structlog

from pnfarm.cli import running
from pnfarm.cli.commands import demo
from pnfarm.table.compiling import compiled


@pytest.fixture
def uncompiled(monkeypatch, tmp_path):
    """A machine whose cache is empty, and whose compiler is a script of the test."""
    monkeypatch.setattr(compiled, "IS_COMPILED", True)
    monkeypatch.setattr(compiled, "is_cached", lambda _part: False)
    monkeypatch.setattr(compiled, "cache_directory", lambda: tmp_path)
    monkeypatch.setattr(running.settings, "log_format", "json")

    def compiler(body, *, in_memory=True):
        script = tmp_path / "compiler"
        script.write_text(f"#!/bin/sh\n{body}\n")
        script.chmod(0o755)
        monkeypatch.setattr(running.sys, "executable", str(script))
        with structlog.testing.capture_logs() as lines:
            anyio.run(partial(running.compile_ahead, in_memory=in_memory))
        return lines

    return compiler


def test_progress_is_reported_as_functions_done_of_all(uncompiled, monkeypatch):
    monkeypatch.setattr(running, "LOG_SECONDS", 0.0)
    lines = uncompiled('echo "$@" > "$0.asked"; echo "1 of 3"; echo "2 of 3"; echo "3 of 3"; echo "3 in /x, 1.0 s"')
    assert lines[0]["event"] == running.COMPILING
    told = [(line["functions"], line["of"]) for line in lines if line["event"] == "compiling"]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert lines[-1]["event"] == "engine compiled"


def test_no_time_is_promised(uncompiled):
    lines = uncompiled('echo "3 of 3"')
    assert not any(character.isdigit() for character in running.COMPILING)
    assert "compiling" not in [line["event"] for line in lines]  # too soon for a line of its own


def test_a_long_compiler_error_is_reported_with_its_last_lines(uncompiled):
    lines = uncompiled("head -c 1000000 /dev/zero | tr '\\0' x >&2; echo 'the last word' >&2; exit 1")
    assert lines[-1]["event"] == "engine not compiled ahead"
    assert lines[-1]["reason"].endswith("the last word")
    assert len(lines[-1]["reason"]) <= 500


def test_on_a_terminal_a_bar_shows_it(uncompiled, monkeypatch, capsys):
    monkeypatch.setattr(running.settings, "log_format", None)
    monkeypatch.setattr(running.sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    lines = uncompiled('echo "226 of 227"')
    assert [line["event"] for line in lines] == ["engine compiled"]
    assert "compiling the engine" in capsys.readouterr().err


def test_the_demo_counts_from_after_the_compilation(monkeypatch):
    clock = [5.0]
    begun = []

    async def compile_ahead(*, in_memory):
        assert in_memory
        clock[0] = 65.0

    class Demo:
        def __init__(self, _text, *, begin, **_options):
            begun.append(begin)

        async def run(self):
            return {"ok": True}

    monkeypatch.setattr(demo, "_enter", lambda: ("memory", "as the test wants it"))
    monkeypatch.setattr(demo.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(running, "compile_ahead", compile_ahead)
    monkeypatch.setattr("pnfarm.cli.demo.run.Demo", Demo)
    demo.command(drives=1, seconds=1.0, json_file=None, svg_file=None, pcap=None)
    assert begun == [65.0]


def test_machine_code_is_ready_only_when_all_of_it_is(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (tmp_path / "some.function-1.py311.nbi").touch()  # a compilation that was interrupted
    assert not compiled.is_cached()
    compiled.mark_cached()
    assert compiled.is_cached()
    # other sources, another version, another bounds check
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "other")
    assert not compiled.is_cached()


def test_what_real_time_needs_can_be_ready_without_the_rest(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    compiled.mark_cached(compiled.REAL_TIME)
    assert compiled.is_cached(compiled.REAL_TIME)
    assert not compiled.is_cached()
    (tmp_path / "all").mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "all"))
    compiled.mark_cached()
    assert compiled.is_cached(compiled.REAL_TIME)


def test_only_a_farm_in_memory_waits_for_what_exchanges_frames_in_memory(uncompiled, tmp_path):
    asked = tmp_path / "compiler.asked"
    for in_memory, arguments in ((True, "--progress"), (False, "--progress --real-time")):
        uncompiled('echo "$@" > "$0.asked"', in_memory=in_memory)
        assert asked.read_text().strip() == f"-m pnfarm.engine.warm {arguments}"


def test_a_missing_cache_folder_is_no_error(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "none"))
    compiled.mark_cached()
    assert not compiled.is_cached()


def test_every_compiled_function_is_counted():
    from numba.core.registry import CPUDispatcher

    import pnfarm.engine.warm  # noqa: F401 - imports every module that has one

    modules = [module for name, module in sys.modules.items() if name.startswith("pnfarm.")]
    found = {
        id(value)
        for module in modules
        for value in vars(module).values()
        if isinstance(value, CPUDispatcher) and value.py_func.__module__.startswith("pnfarm.")
    }
    assert compiled.function_count() >= len(found) > 200
