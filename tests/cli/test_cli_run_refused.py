"""`pnfarm run` against a running farm that refuses the scenario: every error as it is in the file."""

from __future__ import annotations

from fake_api import served


def test_errors_that_a_running_farm_finds_are_a_line_each_as_those_of_a_farm_file(pnfarm, tmp_path):
    path = tmp_path / "a.scenario.yml"
    path.write_text("scenario: a\nsteps:\n  - clear: x\n", "utf-8")
    errors = [
        {"line": "3", "field": "steps[0].clear", "what": "no fault before is called 'x'", "allowed": "a name"},
        {"line": "", "field": "variables", "what": "has no 'y' to set", "allowed": "none"},
    ]
    with served() as farm:
        farm.answer("POST", "scenarios", {"detail": "both in one sentence", "errors": errors}, 422)
        outcome = pnfarm("run", path, "--farm", farm.url)
        farm.answer("POST", "scenarios", {"detail": "four run already"}, 409)
        other = pnfarm("run", path, "--farm", farm.url)
    assert outcome.code == 2
    assert outcome.err.splitlines() == [
        f"{path}: variables: has no 'y' to set; allowed: none",
        f"{path}:3: steps[0].clear: no fault before is called 'x'; allowed: a name",
    ]
    assert (other.code, other.err) == (2, "pnfarm: four run already\n")
