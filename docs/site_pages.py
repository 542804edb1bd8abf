"""Makes pages of a site from the documentation as it lies here: a hook of mkdocs, ``make site``.

The README is the first page. Links to files of the checkout that are no pages become their paths.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any, Final

from mkdocs.structure.files import File, Files

ROOT: Final = Path(__file__).parents[1]
BESIDE: Final = {"README.md": "index.md", "CHANGELOG.md": "changes.md", "CONTRIBUTING.md": "contributing.md"}
_LINK: Final = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://|#|mailto:)([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie beside the folder of the documentation."""
    for name, page in BESIDE.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Lead links to where their targets are on the site."""
    source = {shown: name for name, shown in BESIDE.items()}.get(page.file.src_uri)
    folder = "" if source else posixpath.dirname(f"docs/{page.file.src_uri}")
    here = posixpath.dirname(page.file.src_uri)

    def link(found: re.Match[str]) -> str:
        picture, words, address, anchor = found.groups()
        target = posixpath.normpath(posixpath.join(folder, address))
        if not (ROOT / target).exists():
            return found[0]  # which mkdocs reports
        shown = BESIDE.get(target, target.removeprefix("docs/"))
        if target in BESIDE or (target.startswith("docs/") and files.get_file_from_path(shown)):
            return f"{picture}[{words}]({posixpath.relpath(shown, here or '.')}{anchor or ''})"
        return words if words == target or f"`{target}`" in words else f"{words} (`{target}`)"

    return _LINK.sub(link, markdown)
