"""The pages in a real browser: opened, clicked as a user would, checked for accessibility, on two screens."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium.webdriver import ActionChains, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webdriver import WebDriver
from selenium.webdriver.support.ui import Select, WebDriverWait

from storage.places.data_folder import DataFolder
from tests.dashboards.web.browser import (
    CHROMIUM,
    DESKTOP,
    DRIVER,
    PHONE,
    browser,
    complaints,
    findings,
    shown_at,
)
from tests.dashboards.web.server import served
from tests.dashboards.web.small_data import RETRAINED

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="needs chromium and chromium-driver")

PAGES = (
    "/", "/runs/first", "/runs/first?view=time", "/runs/first/problems?show=slowest",
    "/runs/first/problem?problem=trap-standard-3-0&by=gust&how=repair+5+exhaustive&with=trap",
    "/runs/first/memory?memory=trap&problem=trap-standard-3-0", "/runs/first/try?problem=trap-standard-3-0",
    "/progress", "/compare?first=first&other=second", "/runs/nothing",
)  # fmt: skip


@pytest.fixture(scope="module")
def address(data: DataFolder) -> Iterator[str]:
    with served(data, lambda: RETRAINED) as address:
        yield address


@pytest.fixture(scope="module")
def driver() -> Iterator[WebDriver]:
    with browser() as driver:
        yield driver


@pytest.fixture
def opened(driver: WebDriver, address: str) -> Iterator[Callable[[str], WebDriver]]:
    shown_at(driver, DESKTOP)
    driver.get_log("browser")

    def opened(place: str) -> WebDriver:
        driver.get("about:blank")
        driver.get(address + place)
        return driver

    yield opened
    assert not [each for each in complaints(driver) if "404" not in each]


def wait(driver: WebDriver, so: Callable[[WebDriver], object], seconds: float = 30.0) -> None:
    WebDriverWait(driver, seconds, poll_frequency=0.05).until(so)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("place", PAGES)
def test_a_page_has_no_serious_finding_and_fits_both_screens(
    opened: Callable[[str], WebDriver], place: str, dark: bool
) -> None:
    driver = opened(place)
    for size in (DESKTOP, PHONE):
        shown_at(driver, size, dark)
        if "/try" in place:
            wait(driver, lambda d: d.find_element(By.ID, "editor").get_attribute("data-planned"))
        assert findings(driver) == []
        assert driver.execute_script("return document.documentElement.scrollWidth") <= size[0]


def test_from_the_runs_to_an_attempt_by_clicking(opened: Callable[[str], WebDriver]) -> None:
    driver = opened("/")
    driver.find_element(By.LINK_TEXT, "first").click()
    assert driver.find_elements(By.CSS_SELECTOR, "#chart-reduction svg a")
    driver.find_element(By.CSS_SELECTOR, "#chart-reduction svg a").click()
    assert "/problems" in driver.current_url
    Select(driver.find_element(By.NAME, "show")).select_by_value("slowest")
    wait(driver, lambda d: "show=slowest" in d.current_url)
    driver.find_element(By.CSS_SELECTOR, "td.key a").click()
    first = driver.find_element(By.TAG_NAME, "h1").text
    driver.find_element(By.TAG_NAME, "body").send_keys(Keys.ARROW_RIGHT)
    wait(driver, lambda d: d.find_element(By.TAG_NAME, "h1").text != first)
    kept = driver.current_url
    driver.get("about:blank")
    driver.get(kept)
    assert driver.find_element(By.TAG_NAME, "h1").text != first


def test_the_vehicle_drives_the_plan_to_its_end(opened: Callable[[str], WebDriver]) -> None:
    driver = opened(PAGES[4])
    assert driver.find_element(By.CSS_SELECTOR, ".moving polygon").get_attribute("points")
    slider = driver.find_element(By.ID, "time")
    slider.send_keys(Keys.END)
    x, y = driver.find_element(By.CSS_SELECTOR, ".moving polygon").get_attribute("points").split()[:2]
    assert (float(x) - 50.0) ** 2 + (float(y) - 50.0) ** 2 < 5.0**2
    slider.send_keys(Keys.HOME)
    driver.find_element(By.ID, "play").click()
    wait(driver, lambda d: d.find_element(By.ID, "clock").text not in ("0.0 s", ""))


def test_one_recalled_plan_can_be_seen_alone_and_the_tree_asked_for(
    opened: Callable[[str], WebDriver],
) -> None:
    driver = opened(PAGES[4])
    count = len(driver.find_elements(By.CSS_SELECTOR, ".recalled"))
    driver.find_element(By.CSS_SELECTOR, ".only").click()
    assert len(driver.find_elements(By.CSS_SELECTOR, ".recalled.dimmed")) == count - 1
    driver = opened("/runs/first/problem?problem=trap-standard-3-1&by=gust&how=none")
    driver.find_element(By.PARTIAL_LINK_TEXT, "search tree").click()
    assert driver.find_elements(By.CSS_SELECTOR, "path.tree")
    assert "tree=1" in driver.current_url


def test_a_chart_is_saved_as_a_picture(opened: Callable[[str], WebDriver]) -> None:
    driver = opened("/runs/first")
    button = driver.find_element(By.CSS_SELECTOR, "[data-png]")
    button.click()
    wait(driver, lambda d: int(button.get_attribute("data-saved") or 0) > 5_000)


def planned(driver: WebDriver) -> int:
    return int(driver.find_element(By.ID, "editor").get_attribute("data-planned") or 0)


def after(driver: WebDriver, act: Callable[[], object]) -> None:
    """Do something that changes the world, and wait for the plans that follow."""
    before = planned(driver)
    act()
    wait(driver, lambda d: planned(d) > before)


def test_a_world_is_edited_with_the_mouse_and_planned_at_once(
    opened: Callable[[str], WebDriver], tmp_path: Path
) -> None:
    driver = opened("/runs/first/try?problem=trap-standard-3-0")
    wait(driver, planned)
    count = len(driver.find_elements(By.CSS_SELECTOR, ".obstacle"))
    after(driver, driver.find_element(By.CSS_SELECTOR, "[data-add='4']").click)
    assert len(driver.find_elements(By.CSS_SELECTOR, ".obstacle")) == count + 1
    thing = driver.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon")
    before = thing.get_attribute("points")
    after(driver, ActionChains(driver).drag_and_drop_by_offset(thing, 40, 30).perform)
    moved = driver.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon").get_attribute("points")
    assert moved != before
    handle = driver.find_element(By.CSS_SELECTOR, ".handle")
    after(driver, ActionChains(driver).drag_and_drop_by_offset(handle, 60, 40).perform)
    assert driver.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon").get_attribute("points") != moved
    kept = driver.current_url
    assert "#w=" in kept
    shape = (
        driver.find_elements(By.CSS_SELECTOR, ".obstacle")[-1]
        .find_element(By.TAG_NAME, "polygon")
        .get_attribute("points")
    )
    opened(
        kept.partition("127.0.0.1")[2].partition("/")[1] + kept.partition("127.0.0.1")[2].partition("/")[2]
    )
    wait(driver, planned)
    again = (
        driver.find_elements(By.CSS_SELECTOR, ".obstacle")[-1]
        .find_element(By.TAG_NAME, "polygon")
        .get_attribute("points")
    )
    assert [round(float(x), 2) for x in shape.replace(",", " ").split()] == pytest.approx(
        [round(float(x), 2) for x in again.replace(",", " ").split()], abs=0.02
    )
    after(driver, driver.find_element(By.ID, "clear").click)
    assert "ms" in driver.find_element(By.ID, "ms-alone").text
    assert "ms" in driver.find_element(By.ID, "ms-with").text
    own = {"start": [0, 0, 0.7], "goal": [50, 50], "goal_radius": 2, "bounds": [-7, -7, 57, 57],
           "obstacles": [[[20, 20], [25, 20], [25, 25]]]}  # fmt: skip
    (tmp_path / "own.json").write_text(json.dumps(own), "utf-8")
    after(driver, lambda: driver.find_element(By.ID, "file").send_keys(str(tmp_path / "own.json")))
    assert len(driver.find_elements(By.CSS_SELECTOR, ".obstacle")) == 1


def test_a_world_is_edited_with_keys_alone(opened: Callable[[str], WebDriver]) -> None:
    driver = opened("/runs/first/try?problem=trap-standard-3-0")
    wait(driver, planned)
    count = len(driver.find_elements(By.CSS_SELECTOR, ".obstacle"))
    editor = driver.find_element(By.ID, "editor")
    driver.execute_script("arguments[0].focus()", editor)
    keys = ActionChains(driver)
    keys.send_keys(Keys.TAB).perform()
    before = driver.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon").get_attribute("points")
    after(driver, ActionChains(driver).send_keys(Keys.ARROW_RIGHT, "[").perform)
    assert driver.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon").get_attribute("points") != before
    after(driver, ActionChains(driver).send_keys(Keys.DELETE).perform)
    assert len(driver.find_elements(By.CSS_SELECTOR, ".obstacle")) == count - 1
    after(driver, ActionChains(driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform)
    assert len(driver.find_elements(By.CSS_SELECTOR, ".obstacle")) == count
