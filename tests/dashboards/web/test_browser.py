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

from planners.world.classes.families import families_of
from planners.world.vehicles.vehicle import CAR
from tests.dashboards.web.browser import CHROMIUM, DESKTOP, DRIVER, PHONE, complaints, findings, shown_at

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="needs chromium and chromium-driver")

PAGES = (
    "/", "/runs/first", "/runs/first?view=time", "/runs/first/problems?show=slowest",
    "/runs/first/problem?problem=trap-standard-3-0&by=gust&how=repair+5+exhaustive&with=trap",
    "/runs/first/memory?memory=trap&problem=trap-standard-3-0", "/runs/first/try?problem=trap-standard-3-0",
    "/progress", "/compare?first=first&other=second", "/runs/nothing",
)  # fmt: skip

# a busy browser may come back from ``get`` before the page is there
LOADED = "return location.href !== 'about:blank' && document.readyState === 'complete'"


@pytest.fixture
def opened(driver: WebDriver, server: str) -> Iterator[Callable[[str], WebDriver]]:
    shown_at(driver, DESKTOP)
    driver.get_log("browser")

    def opened(place: str) -> WebDriver:
        driver.get("about:blank")
        driver.get(server + place)
        wait(driver, lambda d: d.execute_script(LOADED))
        return driver

    yield opened
    assert not [each for each in complaints(driver) if "404" not in each]


def wait(driver: WebDriver, so: Callable[[WebDriver], object], seconds: float = 30.0) -> None:
    WebDriverWait(driver, seconds, poll_frequency=0.05).until(so)


def planned(driver: WebDriver) -> int:
    return int(driver.find_element(By.ID, "editor").get_attribute("data-planned") or 0)


@pytest.mark.parametrize("place", PAGES)
def test_a_page_has_no_serious_finding_and_fits_both_screens(
    opened: Callable[[str], WebDriver], place: str
) -> None:
    driver = opened(place)
    if "/try" in place:
        wait(driver, planned)
    for size, dark in ((DESKTOP, False), (PHONE, True)):
        shown_at(driver, size, dark)
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


@pytest.mark.parametrize("place", ["/", "/runs/second"])
def test_the_newest_run_is_compared_with_the_one_before_and_leads_there(
    opened: Callable[[str], WebDriver], place: str
) -> None:
    driver = opened(place)
    wait(driver, lambda d: d.find_element(By.CSS_SELECTOR, "[data-load]").get_attribute("data-loaded"))
    for size, dark in ((PHONE, True), (DESKTOP, False)):
        shown_at(driver, size, dark)
        assert findings(driver) == []
    driver.find_element(By.LINK_TEXT, "Compare them").click()
    assert "first=first&other=second" in driver.current_url


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


def test_a_world_keeps_its_shape_on_every_screen(opened: Callable[[str], WebDriver]) -> None:
    driver = opened(PAGES[4])
    for size in (DESKTOP, PHONE):
        shown_at(driver, size)
        of_goal = "return document.querySelector('.world circle.goal').getBoundingClientRect()"
        disc = driver.execute_script(of_goal)
        assert disc["width"] == pytest.approx(disc["height"], rel=1e-3)


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


def _view(driver: WebDriver, chart: str) -> list[float]:
    drawing = driver.find_element(By.CSS_SELECTOR, f"{chart} .drawing > svg")
    return [float(each) for each in str(drawing.get_dom_attribute("viewBox")).split()]


def test_a_chart_is_zoomed_and_moved_and_its_axis_stays_in_sight(
    opened: Callable[[str], WebDriver],
) -> None:
    driver, chart = opened("/runs/first/memory?memory=trap"), "#chart-map"
    whole, size = _view(driver, chart), driver.find_element(By.CSS_SELECTOR, f"{chart} circle").size
    zoom_in, _, all_of_it = driver.find_elements(By.CSS_SELECTOR, f"{chart} [data-zoom]")
    for width in (DESKTOP, PHONE):
        shown_at(driver, width)
        for times in (2, 4):
            zoom_in.click()
            assert _view(driver, chart)[2:] == pytest.approx([each / times for each in whole[2:]])
        x, y, _, height = before = _view(driver, chart)
        for tick in driver.find_elements(By.CSS_SELECTOR, f"{chart} text.tick[text-anchor=middle]"):
            assert y < float(tick.get_attribute("y")) < y + height
        drawing = driver.find_element(By.CSS_SELECTOR, f"{chart} .drawing > svg")
        ActionChains(driver).drag_and_drop_by_offset(drawing, -40, 0).perform()
        assert _view(driver, chart)[0] > x
        drawing.send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT)
        assert _view(driver, chart)[0] < before[0]
        assert findings(driver) == []
        all_of_it.click()
        assert _view(driver, chart) == whole
    shown_at(driver, DESKTOP)
    assert driver.find_element(By.CSS_SELECTOR, f"{chart} circle").size == size


def after(driver: WebDriver, act: Callable[[], object]) -> None:
    """Do something that changes the world, and wait for the plans that follow."""
    before = planned(driver)
    act()
    wait(driver, lambda d: planned(d) > before)


def obstacles(driver: WebDriver) -> list[str]:
    """The corners of each obstacle in the editor."""
    polygons = driver.find_elements(By.CSS_SELECTOR, ".obstacle polygon:first-child")
    return [polygon.get_attribute("points") for polygon in polygons]


@pytest.fixture
def editor(opened: Callable[[str], WebDriver]) -> WebDriver:
    driver = opened("/runs/first/try?problem=trap-standard-3-0")
    wait(driver, planned)
    return driver


def test_a_world_is_edited_with_the_mouse_and_planned_at_once(editor: WebDriver) -> None:
    before = obstacles(editor)
    after(editor, editor.find_element(By.CSS_SELECTOR, "[data-add='4']").click)
    *others, added = obstacles(editor)
    assert others == before
    thing = editor.find_element(By.CSS_SELECTOR, ".obstacle.chosen polygon")
    after(editor, ActionChains(editor).drag_and_drop_by_offset(thing, 40, 30).perform)
    *others, moved = obstacles(editor)
    assert others == before
    assert moved != added
    handle = editor.find_element(By.CSS_SELECTOR, ".handle")
    after(editor, ActionChains(editor).drag_and_drop_by_offset(handle, 60, 40).perform)
    *others, turned = obstacles(editor)
    assert others == before
    assert turned != moved


def drawn_at(driver: WebDriver, item: str) -> str:
    """The corners of the vehicle at the start or at the goal."""
    return str(driver.find_element(By.CSS_SELECTOR, f".{item} polygon").get_attribute("points"))


def test_the_vehicle_and_the_goal_are_moved_and_a_pose_is_asked_for(editor: WebDriver) -> None:
    start = drawn_at(editor, "start")
    vehicle = editor.find_element(By.CSS_SELECTOR, ".start polygon")
    after(editor, ActionChains(editor).drag_and_drop_by_offset(vehicle, 15, -10).perform)
    assert drawn_at(editor, "start") != start
    after(editor, editor.find_element(By.ID, "undo").click)
    assert drawn_at(editor, "start") == start
    place = editor.find_element(By.CSS_SELECTOR, ".place .goal")
    after(editor, ActionChains(editor).drag_and_drop_by_offset(place, -20, 5).perform)
    after(editor, editor.find_element(By.ID, "arrive").click)
    facing = drawn_at(editor, "pose")
    handle = editor.find_element(By.CSS_SELECTOR, ".handle")
    after(editor, ActionChains(editor).drag_and_drop_by_offset(handle, 30, 30).perform)
    assert drawn_at(editor, "pose") != facing
    last = editor.find_element(By.CSS_SELECTOR, ".alone-plan").get_attribute("points").split()[-1]
    goal = editor.find_element(By.CSS_SELECTOR, ".pose .heading")
    x, y = (float(goal.get_attribute(name)) for name in ("x1", "y1"))
    assert [float(each) for each in last.split(",")] == pytest.approx([x, y], abs=0.11)


@pytest.mark.parametrize("family", families_of(CAR))
def test_manoeuvres_are_planned(opened: Callable[[str], WebDriver], family: str) -> None:
    driver = opened(f"/runs/first/try?class={family}&seed=3")
    wait(driver, planned)
    assert driver.find_elements(By.CSS_SELECTOR, ".pose polygon")
    assert driver.find_elements(By.CSS_SELECTOR, ".alone-plan")


def test_the_address_of_an_edited_world_opens_it_again(editor: WebDriver) -> None:
    after(editor, editor.find_element(By.CSS_SELECTOR, "[data-add='3']").click)
    edited, address = obstacles(editor), editor.current_url
    editor.get("about:blank")
    editor.get(address)
    wait(editor, planned)
    corners = [
        [float(x) for x in each.replace(",", " ").split()] for each in (edited[-1], obstacles(editor)[-1])
    ]
    assert corners[1] == pytest.approx(corners[0], abs=0.01)


def test_an_empty_world_and_one_from_a_file_are_planned(editor: WebDriver, tmp_path: Path) -> None:
    after(editor, editor.find_element(By.ID, "clear").click)
    assert obstacles(editor) == []
    own = {"start": [0, 0, 0.7], "goal": [50, 50], "goal_radius": 2, "bounds": [-7, -7, 57, 57],
           "obstacles": [[[20, 20], [25, 20], [25, 25]]]}  # fmt: skip
    (tmp_path / "own.json").write_text(json.dumps(own), "utf-8")
    after(editor, lambda: editor.find_element(By.ID, "file").send_keys(str(tmp_path / "own.json")))
    assert len(obstacles(editor)) == 1
    assert editor.find_elements(By.CSS_SELECTOR, ".alone-plan")
    assert editor.find_elements(By.CSS_SELECTOR, ".with-plan")


def test_a_world_is_edited_with_keys_alone(editor: WebDriver) -> None:
    before = obstacles(editor)
    editor.execute_script("arguments[0].focus()", editor.find_element(By.ID, "editor"))
    ActionChains(editor).send_keys(Keys.TAB).perform()
    after(editor, ActionChains(editor).send_keys(Keys.ARROW_RIGHT, "[").perform)
    moved, *others = obstacles(editor)
    assert others == before[1:]
    assert moved != before[0]
    after(editor, ActionChains(editor).send_keys(Keys.DELETE).perform)
    assert obstacles(editor) == before[1:]
    after(editor, ActionChains(editor).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform)
    assert obstacles(editor) == [moved, *before[1:]]
