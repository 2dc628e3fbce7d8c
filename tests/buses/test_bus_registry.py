"""What a further bus adds to the program while it is registered, and that nothing of it stays."""

from __future__ import annotations

import pytest
import typer

from pnfarm.buses import registry
from pnfarm.cli.main import main
from pnfarm.errors import ConfigError
from pnfarm.terminal.command import Command, Panel, arranged

pytestmark = pytest.mark.uncompiled


class Bare:
    """Of a bus only what the registry asks for without a drive."""

    name = "bare"
    frame_families = ("cyclic", "whisper")

    def fault_kinds(self):
        return ()

    def kinds_here(self):
        return {}

    def commands(self):
        return self.listed


def listen(seconds: int = 1) -> None:
    """Listen to the bare bus."""
    typer.echo(f"heard nothing for {seconds} s")


@pytest.fixture
def bare():
    made = Bare()
    made.listed = [Command("listen", Panel.CONTROLLER, listen, behind="plc")]
    return made


def test_a_command_of_a_further_bus_is_in_its_help_panel_and_runs(bare, capsys):
    with registry.registered(bare):
        assert main(["--help"]) == 0
        shown = capsys.readouterr().out
        assert main(["listen", "--seconds", "3"]) == 0
        assert capsys.readouterr().out == "heard nothing for 3 s\n"
    controller = shown[shown.index("Controller") : shown.index("Reference")]
    places = [controller.index(f" {name} ") for name in ("plc", "scan", "listen", "record")]
    assert places == sorted(places)
    assert "Listen to the bare bus." in controller


def test_its_frames_can_be_chosen_of_a_capture(bare, capsys):
    with registry.registered(bare):
        assert registry.frame_filters()["acyclic"] >= {"whisper", "dcp"}
        assert registry.frame_filters()["whisper"] == {"whisper"}
        assert main(["decode", "--help"]) == 0
        assert "whisper" in capsys.readouterr().out
    assert "whisper" not in registry.frame_filters()


def test_nothing_of_a_bus_stays_after_its_block(bare, capsys):
    before = registry.fault_kinds()
    with registry.registered(bare):
        assert registry.bus("bare") is bare
        assert registry.fault_kinds() is not before
    with pytest.raises(ZeroDivisionError), registry.registered(bare):
        _ = 1 // 0
    assert "bare" not in registry.BUSES
    with pytest.raises(ConfigError, match="there is no bus 'bare'"):
        registry.bus("bare")
    assert main(["listen"]) == 2
    assert "no such command 'listen'" in capsys.readouterr().err
    assert set(registry.fault_kinds()) == set(before)


def test_a_bus_is_registered_under_a_name_of_its_own():
    with pytest.raises(ValueError, match="'profinet' already"), registry.registered(registry.bus("profinet")):
        pass
    assert list(registry.BUSES) == ["profinet", "ethernetip", "profibus"]


def names(*behind):
    further = [Command(f"new-{place}", Panel.FARM, listen, behind=name) for place, name in enumerate(behind)]
    known = [Command(name, Panel.FARM, listen) for name in ("up", "down")]
    return [command.name for command in arranged(known, further)]


def test_commands_placed_after_the_same_one_keep_their_order():
    assert names("up", "down", "up", "new-0") == ["up", "new-0", "new-3", "new-2", "down", "new-1"]


def test_a_command_has_its_own_name_and_is_placed_after_a_known_one():
    with pytest.raises(ValueError, match="to follow sideways, which is not a command"):
        names("sideways")
    taken = Command("up", Panel.FARM, listen, behind="up")
    with pytest.raises(ValueError, match="two commands are called up"):
        arranged([taken], [taken])
