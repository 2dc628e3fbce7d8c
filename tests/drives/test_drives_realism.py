"""What the models know of noise, latency, boot time and drift, and how a wrong figure is reported."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest
from model_copy import SHIPPED, drop_section, rewrite

from pnfarm.drives.catalogue import model
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.realism import BOUNDS, RANGES, Realism
from pnfarm.errors import ConfigError

#: A model of a further folder needs none of it.


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_model_has_each_figure_with_its_source(name: str) -> None:
    shown = as_json(model(name))["realism"]
    assert shown.keys() == BOUNDS.keys() == {field.name for field in fields(Realism)}
    for key, fact in shown.items():
        assert fact["source"], key
        assert fact["note"], key
        assert fact["value"] == (list if key in RANGES else lambda value: value)(getattr(model(name).realism, key))


def test_the_akds_noise_comes_from_its_manual_and_its_maker() -> None:
    facts = model("akd-profinet").facts
    assert facts["realism.velocity_noise"].source.startswith("7.1.4")
    assert "Kollmorgen" in facts["realism.position_noise"].source
    assert facts["realism.position_noise"].value == 2.0**-17


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("velocity_noise = { value = 1.83", "velocity_noise = { value = -1.0", r"velocity_noise: -1\.0 is not"),
        ("velocity_noise = { value = 1.83", "velocity_noise = { value = 1001", r"not within 0\.\.1000"),
        ("velocity_noise = { value = 1.83", "velocity_noise = { value = nan", r"nan is not within"),
        ("velocity_noise = { value = 1.83", "velocity_noise = { value = true", r"True is not within"),
        ("velocity_noise = { value = 1.83", 'velocity_noise = { value = "loud"', r"'loud' is not within"),
        ("velocity_noise = {", "speed_noise = {", r"speed_noise: there is no such figure; there are velocity"),
        ('unit = "rpm", source = "7.1.4', 'unit = "1/min", source = "7.1.4', r"unit: '1/min'; it is 'rpm'"),
        ("value = [5_000_000, 30_000_000]", "value = 5_000_000", r"parameter_latency_ns: .* is not a list of two"),
        ("value = [5_000_000, 30_000_000]", "value = [5, 6, 7]", r"is not a list of two"),
        ("value = [5_000_000, 30_000_000]", "value = [30, 5]", r"has a lowest value above its highest"),
        ("value = [5_000_000, 30_000_000]", "value = [-1, 5]", r"is not within 0\.\."),
        ("value = [-50.0, 50.0]", "value = [-5000.0, 50.0]", r"clock_drift: .* is not within -1000"),
        ("answer_time_ns = { value = 8_000_000_000", "answer_time_ns = { value = [8]", r"time_ns: \(8,\) is not"),
    ],
)  # fmt: skip
def test_a_wrong_figure_is_named_by_file_section_and_key(folder: Path, old: str, new: str, message: str) -> None:
    path = rewrite(folder, "model.toml", old, new)
    with pytest.raises(ConfigError, match=message) as caught:
        load_model(folder)
    assert str(path) in str(caught.value)


def test_a_model_may_leave_the_section_out(folder: Path) -> None:
    drop_section(folder, "realism")
    assert load_model(folder).realism == Realism()
