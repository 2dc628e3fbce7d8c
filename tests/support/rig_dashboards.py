"""The checked-in dashboards and the queries in them, as Grafana would send them."""

import json
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="promtool is not installed (apt-get install prometheus)"
)
BOARDS = sorted((ROOT / "dashboards" / "json").glob("*.json"))


def board(path):
    return json.loads(path.read_text("utf-8"))


def panels(path):
    """All that show something: no headings."""
    return [panel for panel in board(path)["panels"] if panel["type"] != "row"]


def queries(path, *, drive="axis-01", station=None, seconds=120):
    """What each is called -> query, for one drive, its station and a time range; also of variables that are derived."""
    words = {
        "$__rate_interval": "10s",
        "$__range": f"{seconds}s",
        "$farm": ".*",
        "$drive": drive,
        "$station": station or drive,
    }

    def filled(expression):
        for word, value in words.items():
            expression = expression.replace(word, value)
        assert "$" not in expression.replace("'$1'", ""), expression
        return expression

    found = {
        f"{panel['title']} {target['refId']}": filled(target["expr"])
        for panel in panels(path)
        for target in panel["targets"]
    }
    found |= {f"annotation {note['name']}": filled(note["expr"]) for note in board(path)["annotations"]["list"]}
    found |= {
        f"variable {one['name']}": filled(one["definition"].removeprefix("query_result(").removesuffix(")"))
        for one in board(path)["templating"]["list"]
        if one.get("definition", "").startswith("query_result(")
    }
    return found
