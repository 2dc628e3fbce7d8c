"""Errors, exit codes, global options: what all commands have in common."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from pnfarm.cli.commands import validate
from pnfarm.errors import ConfigError, EnvironmentError_, InternalError, PnfarmError, RemoteError

HEAVY = ("anyio", "fastapi", "httpx", "numba", "numpy", "pydantic", "structlog")


@pytest.fixture
def failing(pnfarm, monkeypatch, tmp_path):
    """``validate`` that raises what it is given."""

    def run(error: BaseException, *options: str):
        def raise_it(_):
            raise error

        monkeypatch.setattr(validate, "read", raise_it)
        return pnfarm(*options, "validate", tmp_path / "any.yml")

    return run


def test_help_lists_the_commands_and_needs_none_of_the_heavy_libraries():
    program = (
        "import sys, pnfarm.cli.main as m; m.main(['--help']); "
        f"assert not (found := set(sys.modules) & set({HEAVY!r})), found"
    )
    run = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    for command in ("up", "down", "validate", "inspect", "fault", "param", "plc", "scan", "models", "schema", "doctor"):
        assert f" {command} " in run.stdout


@pytest.mark.parametrize("line", [(), ("fault",), ("param",)])
def test_a_command_without_a_subcommand_explains_itself(pnfarm, line):
    found = pnfarm(*line)
    assert found.code == 0
    assert "Usage" in found.out


def test_version(pnfarm):
    assert pnfarm("--version").out.startswith("pnfarm 0.")


def test_the_package_runs_as_the_program():
    run = subprocess.run([sys.executable, "-m", "pnfarm", "--version"], check=False, capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith("pnfarm ")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (("bogus",), "no such command 'bogus'"),
        (("models", "--format", "xml"), "invalid value for '--format': 'xml' is not one of 'table', 'json'; see"),
        (("up", "--bogus", "x"), "no such option: --bogus"),
        (("validate",), "missing argument"),
        (("schema",), "missing argument 'farm|scenario|verify'. Choose from: farm, scenario, verify; see"),
        (("schema", "scenario-x"), "'scenario-x'"),
        (("--log-level", "loud", "models"), "'loud'"),
        (("scan", "--interface", "lo", "--seconds", "0"), "--seconds"),
    ],
)
def test_bad_usage_is_one_sentence_and_code_2(pnfarm, line, told):
    found = pnfarm(*line)
    assert found.code == 2
    assert told in found.err
    assert found.err.startswith("pnfarm: ")
    assert found.err.count("\n") == 1
    assert "--help`" in found.err


@pytest.mark.parametrize(
    ("error", "code"),
    [(ConfigError("a"), 2), (RemoteError("a"), 1), (EnvironmentError_("a"), 4), (PnfarmError("a"), 5)],
)
def test_the_kind_of_error_decides_the_exit_code(failing, error, code):
    found = failing(error)
    assert found.code == code
    assert found.err == "pnfarm: a\n"


@pytest.mark.parametrize("error", [ZeroDivisionError("by nought"), InternalError("by nought")])
def test_an_unexpected_exception_is_an_internal_error_without_traceback(failing, error):
    found = failing(error)
    assert found.code == 5
    assert found.err.startswith("pnfarm: internal error: ")
    assert "by nought (please report; details with --debug)" in found.err
    assert found.err.count("\n") == 1


def test_debug_shows_the_traceback(failing):
    found = failing(ZeroDivisionError("by nought"), "--debug")
    assert found.code == 5
    assert "Traceback" in found.err


def test_of_errors_of_several_tasks_the_one_for_the_user_is_shown(failing):
    group = BaseExceptionGroup("tasks", [ValueError("x"), ExceptionGroup("inner", [EnvironmentError_("no privilege")])])
    found = failing(group)
    assert found.code == 4
    assert found.err == "pnfarm: no privilege\n"


def test_ctrl_c_ends_a_short_command_without_a_word(failing):
    found = failing(KeyboardInterrupt())
    assert (found.code, found.err.strip()) == (130, "")


def test_a_closed_pipe_is_no_error():
    line = f"{sys.executable} -m pnfarm.cli.main models akd-profinet --format json | head -n 1; echo ${{PIPESTATUS[0]}}"
    run = subprocess.run(["bash", "-c", line], check=False, capture_output=True, text=True)
    assert run.stdout.split() == ["{", "0"]
    assert run.stderr == ""


def log_line(*options: str) -> str:
    """What ``pnfarm OPTIONS`` and a log entry of the farm and of a library write to standard error."""
    program = (
        "import sys, logging, structlog; from pnfarm.cli import main as m; from pnfarm.cli.commands import validate\n"
        "def read(path):\n"
        "    structlog.get_logger('pnfarm').info('hello', drive='axis-01')\n"
        "    structlog.get_logger('pnfarm').debug('detail')\n"
        "    logging.getLogger('library').warning('careful %s', 1)\n"
        "    logging.getLogger('library').info('chatter')\n"
        "    sys.exit(0)\n"
        "validate.read = read\n"
        "m.main(sys.argv[1:])"
    )
    run = subprocess.run([sys.executable, "-c", program, *options], check=False, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stderr


def test_logs_are_json_where_there_is_no_terminal():
    first, second = map(json.loads, log_line("validate", "x").splitlines())
    assert (first["event"], first["drive"], first["level"]) == ("hello", "axis-01", "info")
    assert (second["event"], second["logger"], second["level"]) == ("careful 1", "library", "warning")


@pytest.mark.parametrize(
    "line", [("--log-format", "console", "validate", "x"), ("validate", "x", "--log-format=console")]
)
def test_logs_are_readable_when_asked_for_before_or_after_the_command(line):
    first, second = log_line(*line).splitlines()
    assert "hello" in first
    assert "drive=axis-01" in first
    assert "careful 1" in second
    assert "{" not in first


def test_log_level_decides_what_is_logged():
    assert log_line("validate", "x", "--log-level", "error") == ""
    assert '"detail"' in log_line("--log-level", "debug", "validate", "x")
