"""A result as CSV: one line a row and quantity, all digits, nothing where there is nothing."""

from __future__ import annotations

import csv
import io

from drs_core.reproduce.origin import in_line
from drs_core.reproduce.result import Result


def csv_text(result: Result) -> str:
    """Intervals stand in two columns, ``…_low`` and ``…_high``; so are the command of now and the row's versions."""
    lines = [_line(result, row, name) for row in result["rows"] for name in row["quantities"]]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def _line(result: Result, row: Result, quantity: str) -> Result:
    line: Result = {"table": result["table"]}
    line |= {key: value for key, value in row.items() if key not in ("quantities", "folder", "made_with")}
    line |= {"episodes": result["episodes"], "quantity": quantity}
    for key, value in row["quantities"][quantity].items():
        if key.endswith("_ci95"):
            line[f"{key}_low"], line[f"{key}_high"] = value or (None, None)
        else:
            line[key] = value
    return line | {"command": result["command"], "versions": in_line(row)}
