"""SVG as text: elements, scales and ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from markupsafe import escape

from planners.world.arrays import Floats


def element(name: str, /, *content: str, **attributes: object) -> str:
    """``<name …>content</name>``; content is markup already, attributes are escaped.

    ``class_`` is written ``class``, other underscores hyphens; floats get two decimals, None is left out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    inner = "".join(content)
    return f"<{name}{written}>{inner}</{name}>" if inner else f"<{name}{written}/>"


def text(said: object, x: float, y: float, **attributes: object) -> str:
    """A text, escaped."""
    return element("text", str(escape(said)), x=x, y=y, **attributes)


def told(said: object) -> str:
    """What is shown where the pointer rests on an element."""
    return element("title", str(escape(said)))


def linked(address: str | None, *content: str, label: str | None = None) -> str:
    """Content that leads somewhere, or just the content."""
    return element("a", *content, href=address, aria_label=label) if address else "".join(content)


def points(places: Floats, decimals: int = 2) -> str:
    """Places ``[n, 2]`` as a list of points."""
    return " ".join(f"{x:.{decimals}f},{y:.{decimals}f}" for x, y in places.tolist())


class Scale(NamedTuple):
    """Values from ``low`` to ``high`` along pixels from ``first`` to ``last``."""

    low: float
    high: float
    first: float
    last: float
    log: bool = False

    def at(self, value: float) -> float:
        """The pixel of a value; what lies beyond an end is put at the end."""
        low, high, value = self.low, self.high, min(max(value, self.low), self.high)
        if self.log:
            low, high, value = math.log(low), math.log(high), math.log(value)
        share = (value - low) / (high - low) if high > low else 0.5
        return self.first + share * (self.last - self.first)

    def places(self, values: Floats) -> Floats:
        """The pixels of values ``[n]``."""
        return np.array([self.at(float(value)) for value in values])

    def ticks(self, about: int = 5) -> list[float]:
        """Round values on the scale."""
        if self.log:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            fine = (1.0, 2.0, 5.0) if math.log10(self.high / self.low) < 2.0 else (1.0,)
            found = [step * 10.0**power for power in powers for step in fine]
            return [each for each in found if self.low * 0.999 <= each <= self.high * 1.001]
        step = _round_step((self.high - self.low) / about)
        first = math.ceil(self.low / step - 1e-9)
        return [i * step for i in range(first, math.floor(self.high / step + 1e-9) + 1)]


def span(values: Iterable[float], least: float | None = None, margin: float = 0.05) -> tuple[float, float]:
    """Ends of an axis for values, a little beyond them; from ``least`` on if given."""
    finite = [value for value in values if math.isfinite(value)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = margin * (high - low) if high > low else 0.5 * abs(high) or 0.5
    return (low - room if least is None else least), high + room


def short(value: float) -> str:
    """A tick's number, as short as it goes."""
    for unit, size in (("M", 1e6), ("k", 1e3)):
        if abs(value) >= 10.0 * size or (abs(value) >= size and unit == "M"):
            return f"{value / size:.3g} {unit}"
    return f"{value:.6g}".replace("-", "−")


def _round_step(step: float) -> float:
    if not step > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= step * 0.999)


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.2f}".rstrip("0").rstrip(".")
    return str(escape(value))
