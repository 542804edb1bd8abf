"""Publish a report as artifacts of the Prefect flow that made it, and log where it is."""

from __future__ import annotations

import base64
import logging
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from dashboards.verdicts.claim_rules import Claim
from storage.places.files import read_text
from storage.places.mirror import fetch, files_in, uri_of
from storage.places.run_folder import RunFolder
from tasks.fan_out.progress_artifact import artifact_key

MAX_IMAGE_BYTES: Final = 700_000  # an artifact is one row in the server's database

_LOG = logging.getLogger(__name__)


def publish(run: RunFolder, claims: Sequence[Claim], pages: Mapping[str, str]) -> None:
    """Publish links to the report, its summary, the verdicts on the claims, and each figure as an image.

    Args:
        run: the run's folder.
        claims: by every method that judges them.
        pages: addresses of pages about the run that a browser elsewhere can open, by their titles.
    """
    from prefect.artifacts import create_image_artifact, create_markdown_artifact, create_table_artifact

    table = [claim._asdict() for claim in claims]
    for title, address in ({"Report": uri_of(run.report)} | dict(pages)).items():
        _LOG.info("%-8s %s", title, address)
    try:
        if "Report" not in pages:  # browsers do not open files from a server's page
            told = f"`{uri_of(run.report)}` on {platform.node()}; `motion-memory dashboard` shows its figures"
            create_markdown_artifact(told, key=_key(run, "report"), description="Where the report is")
        create_markdown_artifact(read_text(run.summary("md")), key=_key(run, "summary"))
        create_table_artifact(table, key=_key(run, "claims"), description="Claims of the paper")
        for figure in files_in(run.figures, "*.png"):
            if fetch(figure).stat().st_size <= MAX_IMAGE_BYTES:
                create_image_artifact(_address(figure), key=_key(run, figure.stem), description=figure.stem)
    except Exception as error:  # the report is complete without them
        _warn("the report", error)
    publish_pages(run, pages)


def publish_pages(run: RunFolder, pages: Mapping[str, str]) -> None:
    """Publish links to ``pages`` about a run, as artifacts of the flow that this is called in."""
    from prefect.artifacts import create_link_artifact

    try:
        for title, address in pages.items():
            create_link_artifact(address, title, key=_key(run, title), description=title)
    except Exception as error:  # they are also in the log
        _warn("the pages", error)


def publish_judgements(run_name: str, verdicts: Sequence[tuple[str, str, str]]) -> None:
    """Publish the verdict on each memory: (name of the memory, one line, the details as Markdown)."""
    from prefect.artifacts import create_markdown_artifact, create_table_artifact

    try:
        for memory, line, markdown in verdicts:
            create_markdown_artifact(markdown, key=artifact_key(f"verdict-{memory}"), description=line)
        table = [{"memory": memory, "verdict": line} for memory, line, _ in verdicts]
        create_table_artifact(table, key=artifact_key("verdicts"), description=run_name)
    except Exception as error:  # champions do not depend on Prefect
        _warn("the verdicts", error)


def _warn(what: str, error: Exception) -> None:
    reason = (str(error) or type(error).__name__).splitlines()[0]
    _LOG.warning("Prefect did not accept all artifacts of %s: %s", what, reason)


def _key(run: RunFolder, name: str) -> str:
    return artifact_key(f"{run.path.name}-{name}")


def _address(picture: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode('ascii')}"
