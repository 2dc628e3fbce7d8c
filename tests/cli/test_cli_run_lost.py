"""`pnfarm run` against a running farm that is lost: the record that is left."""

from __future__ import annotations

from pnfarm.cli import run_remote
from pnfarm.errors import EnvironmentError_
from pnfarm.scenario.definition.file import load_scenario

SCENARIO = """
scenario: lost
farm: http://127.0.0.1:1
steps:
  - find: {for: {n: [1, 2]}, steps: [{expect: {drive: axis-01, that: connected}}], name: the limit}
  - expect: {drive: axis-01, that: powered, name: the end}
"""


class LostFarm:
    """Takes a scenario, and never answers again."""

    address = "http://127.0.0.1:1"

    def __init__(self, *_: object, **__: object) -> None:
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def post(self, *_: str, body: dict[str, object]):
        return {"id": "scenario-1", "seconds": 0.0, "scenario": "lost", "text": body["text"]}

    def get(self, *_: object, **__: object):
        raise EnvironmentError_("no answer")


def test_what_a_lost_farm_did_not_reach_are_the_same_test_cases_as_of_any_run(tmp_path, monkeypatch):
    path = tmp_path / "lost.scenario.yml"
    path.write_text(SCENARIO)
    monkeypatch.setattr(run_remote.client, "FarmClient", LostFarm)
    monkeypatch.setattr(run_remote, "PATIENCE_SECONDS", 0.0)
    record, failure = run_remote.run_remote(load_scenario(path), None, None, None, lambda: "")
    assert isinstance(failure, EnvironmentError_)
    # the expectations of trials are no test cases of their own
    assert [(case["name"], case["verdict"]) for case in record["cases"]] == [
        ("the limit", "not run"), ("the end", "not run"),
    ]  # fmt: skip
    assert (record["verdict"], record["counts"]["not run"]) == ("error", 2)
