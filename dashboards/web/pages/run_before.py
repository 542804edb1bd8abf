"""Whether a run is better than the one before it: a part of the overview, fetched when that is on screen.

Two runs have to be read and compared for it, which may take longer than a page should.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from dashboards.verdicts.comparison_words import grounds, standing
from dashboards.web.data_reader import DataReader
from dashboards.web.page import Page
from dashboards.web.pages.comparison_page import compared
from dashboards.web.parameters import Parameters, link


def against_the_one_before(data: DataReader, params: Parameters) -> Page:
    """How a run stands to the newest older one that was asked for the same problems, or how it was judged."""
    run = data.run(params.run)
    versions, _ = data.versions()
    values: dict[str, Any] = {
        "run": run.path.name,
        "judged": [each for each in versions if each.run == run.path.name and each.verdict],
        "before": None,
        "standing": "",
        "grounds": "",
    }
    before = data.earlier(run)
    if before is not None:
        table = compared(data, before, run)
        values |= {
            "before": before.path.name,
            "when": f"{datetime.fromtimestamp(before.settings.stat().st_mtime, UTC):%Y-%m-%d %H:%M} UTC",
            "address": link("/compare", {"first": before.path.name, "other": run.path.name}),
            "standing": "" if table.empty else standing(table),
            "grounds": "" if table.empty else grounds(table),
        }
    return Page("run_before.html.jinja", run.path.name, run=run.path.name, values=values)
