"""Which telegram a drive has, and what its mapping parameters make of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from drives_kit import Drive, new_drive, refused

from pnfarm.drives.parameters.parameter import ParameterErrorNumber
from pnfarm.drives.parameters.store import (
    ParameterWritten,
    TelegramChanged,
)
from pnfarm.errors import ConfigError
from pnfarm.table.signals import (
    WORD_NONE,
)

if TYPE_CHECKING:
    pass

E = ParameterErrorNumber


def test_the_plugged_module_rules_the_telegram(akd: Drive) -> None:
    assert akd.store.read(922) == [1]
    akd.store.plug_telegram(9)
    assert akd.store.read(922) == [9]
    assert akd.store.get("FBUS.PARAM01") == 9
    assert akd.store.output_words() == akd.model.profidrive.telegrams[9].output_words
    assert akd.store.read(915, 0, 12) == [1, 32, 3, 34, 34, 35, 35, 36, 37, 38, 0, 0]
    assert akd.store.read(916, 0, 6) == [2, 33, 4, 28, 28, 0]
    refused(E.OPERATING_STATE, lambda: akd.store.write(922, 0, [7]))
    refused(E.OPERATING_STATE, lambda: akd.store.write(915, 0, [1]))
    akd.store.plug_telegram(None)
    assert akd.store.read(922) == [1]
    with pytest.raises(ConfigError, match="no telegram 2"):
        akd.store.plug_telegram(2)


def test_pnu_922_chooses_while_no_module_is_plugged(akd: Drive) -> None:
    akd.store.write(922, 0, [351])
    assert akd.store.events() == [TelegramChanged(351), ParameterWritten(922, 0, (351,))]
    assert akd.store.input_words() == akd.model.profidrive.telegrams[351].input_words
    refused(E.VALUE_IMPERMISSIBLE, lambda: akd.store.write(922, 0, [2]))
    akd.axis.drive.state = 4
    refused(E.OPERATING_STATE, lambda: akd.store.write(922, 0, [1]))


def test_telegram_400_takes_a_free_mapping(akd: Drive) -> None:
    akd.store.plug_telegram(400)
    assert akd.store.output_words()[:10] == akd.model.profidrive.telegrams[9].output_words
    akd.store.write(915, 0, [1, 5, 108, 109, 34, 34, 0, 0, 0, 0, 0, 0])
    akd.store.write(916, 0, [2, 6, 52, 28, 28, 104, 104])
    assert TelegramChanged(400) in akd.store.events()
    words = akd.store.output_words()
    assert len(words) == 12
    assert words[:6] == (0, 4, 13 * 4, 14 * 4, 4 * 4 + 1, 4 * 4 + 2)
    assert words[6:] == (WORD_NONE,) * 6
    assert akd.store.read(916, 0, 8) == [2, 6, 52, 28, 28, 104, 104, 0]


@pytest.mark.parametrize(("values", "index"), [([1, 2], 1), ([1, 99], 1), ([1] + [0] * 11 + [5], 12)])
def test_a_wrong_mapping_is_refused_at_its_entry_and_changes_nothing(akd: Drive, values: list[int], index: int) -> None:
    akd.store.plug_telegram(400)
    akd.store.write(915, 0, [0] * 12)
    error = refused(E.VALUE_IMPERMISSIBLE, lambda: akd.store.write(915, 0, values))
    assert error.value == index
    assert akd.store.output_words() == (WORD_NONE,) * 12


@pytest.mark.parametrize("name", ["akd-profinet", "akd-profinet-2012"])
def test_akd_5_11_1_a_mapping_is_written_entry_by_entry(name: str) -> None:
    drive = new_drive(name)
    drive.store.plug_telegram(9)
    drive.store.write(922, 0, [0])
    whole = [1, 5, 34, 34, 36, 0, 35, 35, 0, 0]
    for place, number in enumerate(whole):
        drive.store.write(915, place, [number])
    assert drive.store.read(915, 0, 10) == whole
    signals = [signal and signal.name for signal in drive.store.mapping(setpoint=True)]
    assert signals == ["STW1", "NSOLL_A", *["MDI_TARPOS"] * 2, "MDI_ACC", None, *["MDI_VELOCITY"] * 2, None, None]


def test_telegram_0_maps_freely_within_the_frames_of_the_plugged_module(akd: Drive) -> None:
    akd.store.plug_telegram(1)
    akd.store.write(922, 0, [0])
    assert akd.store.read(922) == [0]
    assert akd.store.output_words() == akd.model.profidrive.telegrams[1].output_words
    akd.store.write(916, 1, [52])
    assert akd.store.input_words() == (0, 5 * 4)
    refused(E.VALUE_IMPERMISSIBLE, lambda: akd.store.write(916, 2, [6]))


def test_a_mapping_too_long_for_the_module_is_cut_without_tearing_a_double_word(akd: Drive) -> None:
    akd.store.commission({922: 0, 916: [2, 28, 28, 52]})
    akd.store.power_on()
    akd.store.plug_telegram(1)
    assert akd.store.input_words() == (0, WORD_NONE)
    akd.store.plug_telegram(350)
    assert akd.store.input_words() == (0, 4 * 4 + 1, 4 * 4 + 2)


# non-volatile memory
