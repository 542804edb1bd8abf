"""The view of MLflow's table of runs that shows what each run gained, one row a run.

MLflow 3.15 and later keep such views as tags of the experiment, and list them under *Views*; see
``mlflow.sharedViewState`` in its pages. Earlier ones ignore the tag.
"""

from __future__ import annotations

import json
import time
from typing import Final

KEY: Final = "motion-memory"  # of the view in the address of the page
TAG: Final = f"mlflow.sharedViewState.{KEY}"
_COLUMNS: Final = (
    "metrics.`1-gain/sooner_s`",
    "metrics.`1-gain/faster`",
    "metrics.`2-with/solved`",
    "metrics.`2-with/recalled`",
    "metrics.`4-recall/hit_1`",
    "metrics.`5-saved/all`",
    "tags.`preset`",
    "tags.`classes`",
    "params.`seed`",
)


def runs_view(parents: str) -> str:
    """The value of the tag ``TAG``; the condition ``parents`` selects the runs that are shown."""
    now = int(1000 * time.time())
    state = {
        "searchFilter": parents,
        "orderByKey": "attributes.start_time",
        "orderByAsc": False,
        "selectedColumns": _COLUMNS,
        "columnOrder": _COLUMNS,
    }
    named = {"name": "What runs gain", "createdAt": now, "updatedAt": now, "state": json.dumps(state)}
    return json.dumps(named)
