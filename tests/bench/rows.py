"""The rows that tests/bench/run reads from the output of a command, a line of JSON each."""

from __future__ import annotations

import json


def row(name: str, value: float | None, unit: str) -> None:
    """Prints a row; None was not reached. tests/goals.toml has its goal."""
    print(json.dumps({"name": name, "value": value, "unit": unit}, ensure_ascii=False), flush=True)
