"""Every reading of every open point of every model does what it says, and another thing than its siblings."""

import importlib
from dataclasses import replace
from pathlib import Path

import pytest
from open_points import OBSERVATIONS

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.behaviour import with_behaviour

for module in sorted(Path(__file__).parent.glob("observe_*.py")):
    importlib.import_module(module.stem)

POINTS = [(name, point) for name in sorted(models()) for point in model(name).behaviour]
READINGS = [(name, point.name, reading) for name, point in POINTS for reading in point.readings]


@pytest.mark.parametrize(("name", "point", "reading"), READINGS)
def test_a_drive_does_what_the_reading_in_its_farm_file_says(name, point, reading):
    seen = OBSERVATIONS[point]
    assert seen.look(name, f"{{{point}: {reading}}}") == seen.shows[reading]


@pytest.mark.parametrize("name", sorted(models()))
def test_a_farm_file_that_chooses_nothing_has_the_defaults(name):
    defaults = {point.name: point.default for point in model(name).behaviour}
    assert with_behaviour(model(name), defaults) == replace(model(name), readings=defaults)


def test_no_reading_is_without_a_test_and_no_two_of_a_point_show_the_same():
    wanted = {(point.name, reading) for _, point in POINTS for reading in point.readings}
    shown = {(point, reading) for point, seen in OBSERVATIONS.items() for reading in seen.shows}
    assert shown == wanted
    for name, point in POINTS:
        shows = [OBSERVATIONS[point.name].shows[reading] for reading in point.readings]
        assert len(set(shows)) == len(shows), f"{name}, {point.name}"
