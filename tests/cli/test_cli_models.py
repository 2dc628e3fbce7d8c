"""``pnfarm models MODEL``: what is known of a drive, for people, each value with its source."""

from __future__ import annotations

import pytest

from pnfarm.cli.models import models as print_models
from pnfarm.cli.settings import Format
from pnfarm.drives.catalogue import model, models


@pytest.mark.parametrize("name", sorted(models()))
def test_a_model_is_printed_for_people_with_each_of_its_facts(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    print_models(name, Format.TABLE)
    printed = capsys.readouterr().out
    for key in model(name).facts:
        section, *parts = key.split(".")
        title = f"MOTORS {parts.pop(0)}" if section == "motors" else section.replace("_", " ").upper()
        assert f"\n{title}" in printed, key
        assert " ".join(parts).replace("_", " ") in printed, key
