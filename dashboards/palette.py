"""The colours of figures and pages, in one place; any colour vision tells Okabe and Ito's apart."""

from __future__ import annotations

from typing import Final

from dashboards.statistics.distributions import REST, TIME_PARTS
from storage.tables.configurations import Configuration

SKY: Final = "#56B4E9"
BLUE: Final = "#0072B2"
ORANGE: Final = "#E69F00"
VERMILLION: Final = "#D55E00"
GREEN: Final = "#009E73"
PURPLE: Final = "#CC79A7"
YELLOW: Final = "#D8C72E"  # darker than theirs, which can hardly be seen on white
GREY: Final = "#8C8C8C"
INK: Final = "#222222"
PALE: Final = "#E4E4E4"
OBSTACLE: Final = "#6B7280"
UNKNOWN: Final = "#F1DFB8"  # cells of a map that nobody has seen

SERIES: Final = (BLUE, VERMILLION, GREEN, ORANGE, SKY, PURPLE, YELLOW)  # of planners, of plans, …
TIME_COLOURS: Final = dict(
    zip(
        [*(part.name for part in TIME_PARTS), REST],
        (SKY, BLUE, PURPLE, GREY, YELLOW, GREEN, ORANGE, VERMILLION, PALE),
        strict=True,
    )
)
_ASSISTS: Final = {  # with one recalled plan, and with more
    "none": (GREY, GREY),
    "closed": (SKY, BLUE),
    "open": (ORANGE, VERMILLION),
    "published-open": (ORANGE, VERMILLION),
    "repair": (GREEN, GREEN),
    "fresh": (YELLOW, YELLOW),
}
_LIGHT: Final = {  # of pages, by the name of the variable in their style sheets
    "ink": INK, "soft": "#565B63", "paper": "#FFFFFF", "raised": "#F4F5F7", "line": "#D5D9DF",
    "link": "#00588C", "bad": "#A33B00", "good": "#00664A", "warm": "#FFF4D6",
    "obstacle": OBSTACLE, "goal": ORANGE, "found": GREEN, "free": SKY, "blocked": VERMILLION,
    "alone": PURPLE, "road": "#9AA1AB", "tree": "#B06D96",
}  # fmt: skip
_DARK: Final = {
    "ink": "#E9EAEC", "soft": "#A9AFB8", "paper": "#16181C", "raised": "#23262C", "line": "#3B4048",
    "link": "#7CC4F5", "bad": "#FF9A5C", "good": "#4FC9A2", "warm": "#3A3115",
    "obstacle": "#8B93A1", "found": "#35C79B", "road": "#6B7380", "tree": "#C58BB0",
}  # fmt: skip


def colour_of(configuration: Configuration) -> str:
    """The colour of a ``configuration``, the same everywhere; lighter with one recalled plan."""
    if configuration.recall == "random":
        return PURPLE
    return _ASSISTS.get(configuration.assist, (INK, INK))[configuration.top_k > 1]


def style_sheet(dark: bool = True) -> str:
    """The colours as variables of CSS: for a light screen, and with ``dark`` for a dark one too."""
    light, night = (
        f":root {{ {' '.join(f'--{name}: {colour};' for name, colour in colours.items())} }}"
        for colours in (_LIGHT, _DARK)
    )
    return f"{light}\n@media (prefers-color-scheme: dark) {{ {night} }}\n" if dark else f"{light}\n"
