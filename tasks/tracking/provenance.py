"""The origin of a run in MLflow: who started it, from which commit, and which run in Prefect."""

from __future__ import annotations

import getpass
import sys
from pathlib import Path

from tasks.attempts.attempt_rows import commit
from tasks.settings.redaction import redacted


def provenance() -> dict[str, str]:
    """Tags with the names that MLflow shows as user, source and version; unknown ones are left out."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError, ImportError):  # a container whose user has no name
        user = ""
    tags = {
        "mlflow.user": user,
        "mlflow.source.type": "LOCAL",
        "mlflow.source.name": Path(sys.argv[0]).name,
        "mlflow.source.git.commit": commit(),
    }
    return {name: value for name, value in (tags | flow_run_tags()).items() if value}


def flow_run_tags() -> dict[str, str]:
    """The run in Prefect that this is called in, and its page; nothing outside of Prefect."""
    from prefect.runtime import flow_run

    if not flow_run.id:
        return {}
    page = redacted(str(flow_run.ui_url or ""))
    return {"prefect.flow_run": str(flow_run.id), "prefect.flow_run_name": flow_run.name or ""} | (
        {"prefect.flow_run_url": page} if page else {}
    )
