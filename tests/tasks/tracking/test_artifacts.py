from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = """
from pathlib import Path
from storage.places.run_folder import RunFolder
from tasks.tracking.artifacts import publish
run = RunFolder(Path.cwd() / "laptop-1")
run.figures.mkdir(parents=True)
run.summary("md").write_text("# A run")
(run.figures / "planning-times.png").write_bytes(b"png")
publish(run, [], {})
print("done")
"""


def test_without_a_server_a_report_is_whole_and_says_so_in_one_line(tmp_path: Path) -> None:
    nobody = {
        "PREFECT_API_URL": "http://127.0.0.1:9/api",
        "PREFECT_CLIENT_MAX_RETRIES": "0",
        "PREFECT_HOME": str(tmp_path),
        "PYTHONPATH": str(Path(__file__).parents[3]),
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        capture_output=True, text=True, timeout=120, cwd=tmp_path, env=os.environ | nobody,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "done\n")
    assert done.stderr.splitlines()[-1].startswith("Prefect did not accept all artifacts of the report: ")
