"""Run the flow of docs/python.md: its source, a file of problems and a memory are given."""

import sys
from pathlib import Path
from typing import Any

source, problems, memory = sys.argv[1:]
scope: dict[str, Any] = {"__name__": "example"}
exec(compile(Path(source).read_text(), source, "exec"), scope)
print(scope["plan_all"](problems, memory))
