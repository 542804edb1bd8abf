"""Pictures of every page for the docs: ``python -m tests.dashboards.web.pictures DATA RUN OTHER OUT``."""

from __future__ import annotations

import sys
from pathlib import Path
from urllib.parse import quote_plus

import pandas as pd
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from storage.places.data_folder import DataFolder
from storage.tables.attempts import read_attempts
from tests.dashboards.web.browser import DESKTOP, PHONE, browser, complaints, findings, shown_at
from tests.dashboards.web.server import served


def main(data: str, run: str, other: str, out: str) -> None:
    """Take them, and say what the console and axe have to say."""
    folder = DataFolder(Path(data).absolute())
    rows = read_attempts(folder.run(run).results, ("recalled",))
    places = pages(run, other, rows)
    Path(out).mkdir(parents=True, exist_ok=True)
    with served(folder) as address, browser() as driver:
        for name, place in places.items():
            for size, kind in ((DESKTOP, "wide"), (PHONE, "phone")):
                shown_at(driver, size)
                driver.get("about:blank")
                driver.get(address + place)
                WebDriverWait(driver, 30).until(
                    lambda d: not d.find_elements(By.CSS_SELECTOR, "[data-load]:not([data-loaded])")
                )
                if "/try" in place:
                    WebDriverWait(driver, 30).until(
                        lambda d: d.find_element(By.ID, "editor").get_attribute("data-planned")
                    )
                if name == "problem":
                    driver.execute_script(
                        "const t = document.getElementById('time'); t.value = 90; t.dispatchEvent(new "
                        "Event('input'))"
                    )
                driver.save_screenshot(str(Path(out) / f"dashboard-{name}-{kind}.png"))
                print(name, kind, complaints(driver), findings(driver))


def pages(run: str, other: str, rows: pd.DataFrame) -> dict[str, str]:
    """Every page, with an attempt that has something to show."""
    shown = rows[(rows["assist"] == "repair") & (rows["source"] == "repaired") & (rows["planner"] == "gust")]
    row = (shown if len(shown) else rows[rows["assist"] == "repair"]).iloc[0]
    how = f"repair {row['top_k']} {row['recall']}"
    asked = f"problem={row['problem_id']}&by={row['planner']}&how={quote_plus(how)}&with={row['memory']}"
    base = f"/runs/{run}"
    return {
        "runs": "/", "overview": base, "time": f"{base}?view=time", "problems": f"{base}/problems?show=hurt",
        "problem": f"{base}/problem?{asked}", "memory": f"{base}/memory?memory={row['memory']}",
        "neighbours": f"{base}/memory?memory={row['memory']}&problem={row['problem_id']}",
        "try": f"{base}/try?problem={row['problem_id']}&class={row['problem_class']}",
        "manoeuvre": f"{base}/try?class=parallel&seed=3",
        "progress": "/progress", "compare": f"/compare?first={run}&other={other}",
    }  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:5])
