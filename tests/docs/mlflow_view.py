"""Two runs beside each other in MLflow: ``python -m tests.docs.mlflow_view DATA RUN OTHER PICTURE``."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import quote

from mlflow import MlflowClient
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from storage.places.data_folder import DataFolder
from tasks.servers.prefect_server import set_environment
from tasks.tracking.mlflow_runs import EXPERIMENT, tracker
from tests.cluster.machines import answers, free_port
from tests.dashboards.web.browser import browser, shown_at

SCREEN = (1280, 1160)
ONLY_DIFFERENCES = """
for (const close of document.querySelectorAll("button[aria-label='Close']")) close.click();
for (const only of document.querySelectorAll("button[role=switch]")) only.click();
for (const title of document.querySelectorAll("[role=button], button"))
  if (["Visualizations", "Run details"].includes(title.textContent.trim())) title.click();
"""


def main(data: str, run: str, other: str, picture: str) -> None:
    """Open MLflow's own comparison of two runs of a data folder."""
    folder = DataFolder(Path(data).absolute())
    set_environment(folder.path)
    found = tracker(str(folder.path))
    identities = [found.find(name, "run") for name in (run, other)]
    experiment = MlflowClient(found.uri).get_experiment_by_name(EXPERIMENT).experiment_id
    address = f"http://127.0.0.1:{free_port()}"
    port = address.rpartition(":")[2]
    command = [str(Path(sys.executable).parent / "mlflow"), "ui", "--host", "127.0.0.1", "--port", port]
    server = subprocess.Popen([*command, "--backend-store-uri", found.uri, "--workers", "1"])
    try:
        while not answers(f"{address}/health"):
            time.sleep(0.5)
        with browser() as driver:
            shown_at(driver, SCREEN)
            asked = f"runs={quote(json.dumps(identities))}&experiments={quote(json.dumps([experiment]))}"
            driver.get(f"{address}/#/compare-runs?{asked}")
            WebDriverWait(driver, 60).until(
                lambda page: "1-gain/sooner_s" in page.find_element(By.TAG_NAME, "body").text
            )
            driver.execute_script(ONLY_DIFFERENCES)
            time.sleep(1.0)
            driver.save_screenshot(picture)
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main(*sys.argv[1:5])
