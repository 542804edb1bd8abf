"""A report as artifacts of the Prefect flow that made it; where Prefect cannot be reached, nothing breaks."""

from __future__ import annotations

import base64
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from dashboards.verdicts import Claim
from storage.files import read_text
from storage.layout import RunFolder
from storage.mirror import fetch, files_in, uri_of

MAX_IMAGE_BYTES: Final = 700_000  # an artifact is a row of the server's database


def publish(run: RunFolder, claims: Sequence[Claim]) -> None:
    """Link the page, and add the summary, the verdicts on the claims, and every figure as an image."""
    from prefect.artifacts import (
        create_image_artifact,
        create_link_artifact,
        create_markdown_artifact,
        create_table_artifact,
    )

    def key(name: str) -> str:
        return re.sub(r"[^a-z0-9]+", "-", f"{run.path.name}-{name}".lower()).strip("-")

    told = [claim._asdict() for claim in claims]
    try:
        create_link_artifact(uri_of(run.report), "Report", key=key("report"), description="Whole page")
        create_markdown_artifact(read_text(run.summary("md")), key=key("summary"))
        create_table_artifact(told, key=key("claims"), description="Claims of the paper")
        for figure in files_in(run.figures, "*.png"):
            if fetch(figure).stat().st_size <= MAX_IMAGE_BYTES:
                create_image_artifact(_address(figure), key=key(figure.stem), description=figure.stem)
    except Exception as error:  # a report is whole without its artifacts, whatever is wrong with the server
        reason = (str(error) or type(error).__name__).splitlines()[0]
        print(f"Prefect has not got all artifacts of the report: {reason}", file=sys.stderr)


def _address(picture: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode('ascii')}"
