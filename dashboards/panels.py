"""Grafana's panels as Python functions: what the two dashboards need of Grafana's JSON model (schema version 39).

A panel function returns the panel without its place; :class:`Board` lays panels out from left to right on Grafana's
grid of 24 columns and numbers them.
"""

from __future__ import annotations

from typing import Any

GRID = 24
SCHEMA_VERSION = 39
DATASOURCE = {"type": "prometheus", "uid": "${datasource}"}
#: Grafana's names of its own palette, readable on light and dark ground.
GREEN, YELLOW, ORANGE, RED, BLUE, PURPLE, GREY = "green", "yellow", "orange", "red", "blue", "purple", "#8e8e8e"

Json = dict[str, Any]


def target(
    expression: str,
    legend: str = "",
    *,
    ref: str = "A",
    instant: bool = False,
    table: bool = False,
    heatmap: bool = False,
) -> Json:
    """One query.  ``instant``: the newest value only."""
    return {
        "refId": ref,
        "datasource": DATASOURCE,
        "expr": expression,
        "legendFormat": legend or "__auto",
        "instant": instant,
        "range": not instant,
        "format": "table" if table else "heatmap" if heatmap else "time_series",
    }


def targets(*queries: tuple[str, str]) -> list[Json]:
    """Range queries with their legends."""
    return [target(expression, legend, ref=chr(ord("A") + i)) for i, (expression, legend) in enumerate(queries)]


def thresholds(*steps: tuple[float | None, str]) -> Json:
    """Colours from a value on; the first step has None."""
    return {"mode": "absolute", "steps": [{"value": value, "color": color} for value, color in steps]}


def value_names(names: dict[int, tuple[str, str]]) -> list[Json]:
    """Text and colour for a value."""
    options = {
        str(value): {"index": index, "text": text, "color": color}
        for index, (value, (text, color)) in enumerate(names.items())
    }
    return [{"type": "value", "options": options}]


def zero_is(text: str) -> Json:
    """A mapping for 0."""
    return {"type": "value", "options": {"0": {"index": 0, "text": text, "color": GREEN}}}


def link(title: str, url: str) -> Json:
    """A link from a value to another dashboard."""
    return {"title": title, "url": url, "targetBlank": False}


def override(name: str, **properties: Any) -> Json:
    """Properties of the field called ``name``; a double underscore in a key stands for a dot."""
    return {
        "matcher": {"id": "byName", "options": name},
        "properties": [{"id": key.replace("__", "."), "value": value} for key, value in properties.items()],
    }


def color(name: str) -> Json:
    """A fixed colour."""
    return {"mode": "fixed", "fixedColor": name}


def _panel(kind: str, title: str, queries: list[Json], description: str, defaults: Json, options: Json) -> Json:
    return {
        "type": kind,
        "title": title,
        "description": description,
        "datasource": DATASOURCE,
        "targets": queries,
        "fieldConfig": {"defaults": defaults, "overrides": []},
        "options": options,
    }


def stat(
    title: str,
    queries: list[Json],
    description: str,
    *,
    unit: str = "none",
    steps: Json | None = None,
    mappings: list[Json] | None = None,
    decimals: int | None = None,
    sparkline: bool = False,
    no_value: str = "-",
    text_mode: str = "auto",
    links: list[Json] | None = None,
) -> Json:
    """One big number."""
    defaults: Json = {
        "unit": unit,
        "noValue": no_value,
        "color": {"mode": "thresholds"},
        "thresholds": steps or thresholds((None, BLUE)),
        "mappings": mappings or [],
        "links": links or [],
    }
    if decimals is not None:
        defaults["decimals"] = decimals
    options = {
        "reduceOptions": {"calcs": ["lastNotNull"], "fields": "", "values": False},
        "colorMode": "value",
        "graphMode": "area" if sparkline else "none",
        "justifyMode": "auto",
        "orientation": "auto",
        "textMode": text_mode,
    }
    return _panel("stat", title, queries, description, defaults, options)


def timeseries(
    title: str,
    queries: list[Json],
    description: str,
    *,
    unit: str = "none",
    minimum: float | None = None,
    stacked: bool = False,
    steps: bool = False,
    overrides: list[Json] | None = None,
    calcs: list[str] | None = None,
    links: list[Json] | None = None,
    no_value: str = "",
) -> Json:
    """Curves; ``steps`` for values that jump, ``stacked`` for parts of a whole."""
    defaults: Json = {
        "unit": unit,
        "color": {"mode": "palette-classic"},
        "links": links or [],
        "custom": {
            "drawStyle": "line",
            "lineInterpolation": "stepAfter" if steps else "linear",
            "lineWidth": 1,
            "fillOpacity": 60 if stacked else 8,
            "showPoints": "never",
            "spanNulls": False,
            "stacking": {"mode": "normal" if stacked else "none", "group": "A"},
        },
    }
    if minimum is not None:
        defaults["min"] = minimum
    if no_value:
        defaults["noValue"] = no_value
    options = {
        "legend": {
            "displayMode": "table" if calcs else "list",
            "placement": "bottom",
            "showLegend": True,
            "calcs": calcs or [],
        },
        "tooltip": {"mode": "multi", "sort": "desc"},
    }
    panel = _panel("timeseries", title, queries, description, defaults, options)
    panel["fieldConfig"]["overrides"] = overrides or []
    return panel


def state_timeline(
    title: str,
    queries: list[Json],
    description: str,
    names: dict[int, tuple[str, str]],
    *,
    no_value: str = "",
    links: list[Json] | None = None,
) -> Json:
    """One bar per series, coloured by its value's text."""
    defaults: Json = {
        "color": {"mode": "thresholds"},
        "thresholds": thresholds((None, GREY)),
        "mappings": value_names(names),
        "custom": {"fillOpacity": 75, "lineWidth": 0, "spanNulls": False},
        "links": links or [],
    }
    if no_value:
        defaults["noValue"] = no_value
    options = {
        "mergeValues": True,
        "showValue": "auto",
        "alignValue": "left",
        "rowHeight": 0.85,
        "legend": {"displayMode": "list", "placement": "bottom", "showLegend": False},
        "tooltip": {"mode": "single", "sort": "none"},
    }
    return _panel("state-timeline", title, queries, description, defaults, options)


def heatmap(title: str, expression: str, description: str) -> Json:
    """Buckets of a histogram over time; the vertical axis is seconds."""
    options = {
        "calculate": False,
        "cellGap": 1,
        "color": {
            "mode": "scheme",
            "scheme": "Oranges",
            "steps": 64,
            "scale": "exponential",
            "exponent": 0.5,
            "reverse": False,
        },
        "filterValues": {"le": 1e-9},
        "rowsFrame": {"layout": "le"},
        "legend": {"show": True},
        "showValue": "never",
        "tooltip": {"mode": "single", "yHistogram": True, "showColorScale": False},
        "yAxis": {"axisPlacement": "left", "reverse": False, "unit": "s"},
    }
    queries = [target(expression, "{{le}}", heatmap=True)]
    return _panel(
        "heatmap", title, queries, description, {"custom": {"scaleDistribution": {"type": "linear"}}}, options
    )


def table(title: str, columns: list[tuple[str, str]], description: str, overrides: list[Json]) -> Json:
    """One row per drive; ``columns`` are names and instant queries that keep only the label ``drive``."""
    queries = [
        target(expression, ref=chr(ord("A") + i), instant=True, table=True) for i, (_, expression) in enumerate(columns)
    ]
    renamed = {f"Value #{chr(ord('A') + i)}": name for i, (name, _) in enumerate(columns)}
    order = {"drive": 0, **{value: 1 + i for i, value in enumerate(renamed)}}
    defaults: Json = {"custom": {"align": "auto", "cellOptions": {"type": "auto"}, "filterable": True}}
    options = {"showHeader": True, "cellHeight": "sm", "sortBy": [{"displayName": "Drive", "desc": False}]}
    panel = _panel("table", title, queries, description, defaults, options)
    panel["fieldConfig"]["overrides"] = overrides
    panel["transformations"] = [
        {"id": "merge", "options": {}},
        {
            "id": "organize",
            "options": {
                "excludeByName": {"Time": True},
                "indexByName": order,
                "renameByName": {"drive": "Drive", **renamed},
            },
        },
    ]
    return panel


class Board:
    """Builds a dashboard."""

    def __init__(self, uid: str, title: str, description: str, tags: list[str]) -> None:
        self._x = self._y = self._height = 0
        self.panels: list[Json] = []
        self.json: Json = {
            "uid": uid,
            "title": title,
            "description": description,
            "tags": tags,
            "schemaVersion": SCHEMA_VERSION,
            "version": 1,
            "editable": True,
            "graphTooltip": 1,
            "timezone": "browser",
            "refresh": "5s",
            "time": {"from": "now-15m", "to": "now"},
            "timepicker": {"refresh_intervals": ["2s", "5s", "10s", "30s", "1m"]},
            "annotations": {"list": []},
            "templating": {
                "list": [{"name": "datasource", "label": "Data source", "type": "datasource", "query": "prometheus"}]
            },
            "links": [],
            "panels": self.panels,
        }

    def variable(
        self, name: str, label: str, metric: str, values_of: str, *, everything: bool, description: str
    ) -> None:
        """A variable: one of a label's values."""
        query = f"label_values({metric}, {values_of})"
        found: Json = {
            "name": name,
            "label": label,
            "description": description,
            "type": "query",
            "datasource": DATASOURCE,
            "definition": query,
            "query": {"query": query, "refId": f"variable-{name}"},
            "refresh": 2,
            "sort": 7,
            "multi": False,
            "includeAll": everything,
        }
        if everything:
            found["allValue"] = ".*"
            found["current"] = {"text": "All", "value": "$__all", "selected": True}
        self.json["templating"]["list"].append(found)

    def derived(self, name: str, expression: str, label: str, *, description: str) -> None:
        """A variable that nobody chooses: a label's value in the answer to a query."""
        query = f"query_result({expression})"
        self.json["templating"]["list"].append(
            {
                "name": name,
                "description": description,
                "type": "query",
                "hide": 2,
                "datasource": DATASOURCE,
                "definition": query,
                "query": {"query": query, "refId": f"variable-{name}"},
                "regex": f'/{label}="([^"]+)"/',
                "refresh": 2,
            }
        )

    def annotation(self, name: str, expression: str, title: str, text: str, shade: str) -> None:
        """Marks on every curve while the query has a value."""
        self.json["annotations"]["list"].append(
            {
                "name": name,
                "datasource": DATASOURCE,
                "enable": True,
                "hide": False,
                "iconColor": shade,
                "expr": expression,
                "step": "2s",
                "titleFormat": title,
                "textFormat": text,
                "target": {"refId": "Anno", "expr": expression},
            }
        )

    def dashboard_link(self, title: str, url: str) -> None:
        """A link in the header that keeps the time range."""
        self.json["links"].append(
            {
                "title": title,
                "type": "link",
                "url": url,
                "icon": "dashboard",
                "keepTime": True,
                "includeVars": False,
                "targetBlank": False,
                "asDropdown": False,
                "tags": [],
                "tooltip": "",
            }
        )

    def row(self, title: str) -> None:
        """A heading for the panels that follow."""
        self._wrap()
        self._place({"type": "row", "title": title, "collapsed": False, "panels": []}, GRID, 1)
        self._wrap()

    def add(self, panel: Json, width: int, height: int) -> None:
        """Place a panel right of the last one, or below when the line is full."""
        if self._x + width > GRID:
            self._wrap()
        self._place(panel, width, height)

    def _place(self, panel: Json, width: int, height: int) -> None:
        panel["id"] = len(self.panels) + 1
        panel["gridPos"] = {"x": self._x, "y": self._y, "w": width, "h": height}
        self.panels.append(panel)
        self._x += width
        self._height = max(self._height, height)

    def _wrap(self) -> None:
        self._x = 0
        self._y += self._height
        self._height = 0
