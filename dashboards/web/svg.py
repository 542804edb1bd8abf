"""SVG as text: elements, and the scale of an axis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from markupsafe import escape

from planners.world.arrays import Floats


def element(name: str, /, *content: str, **attributes: object) -> str:
    """``<name …>content</name>``; ``content`` is markup already, ``attributes`` are escaped.

    ``class_`` is written ``class``, other underscores hyphens; floats get two decimals, None is left out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_written(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    inner = "".join(content)
    return f"<{name}{written}>{inner}</{name}>" if inner else f"<{name}{written}/>"


def text(words: object, x: float, y: float, **attributes: object) -> str:
    """A text at ``x``, ``y`` in pixels; ``words`` are escaped."""
    return element("text", str(escape(words)), x=x, y=y, **attributes)


def tooltip(words: str) -> str:
    """What shows where the pointer rests on an element; empty for no ``words``."""
    return element("title", str(escape(words))) if words else ""


def linked(address: str | None, *content: str, label: str | None = None) -> str:
    """``content`` that leads to an ``address``, if there is one; screen readers say the ``label``."""
    return element("a", *content, href=address, aria_label=label) if address else "".join(content)


def points(places: Floats) -> str:
    """``places [n, 2]`` as a list of points."""
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in places.tolist())


class Scale(NamedTuple):
    """Values from ``low`` to ``high`` along pixels from ``first`` to ``last``."""

    low: float
    high: float
    first: float
    last: float

    def at(self, value: float) -> float:
        """The pixel of a ``value``; one beyond an end is put at the end."""
        share = (value - self.low) / (self.high - self.low) if self.high > self.low else 0.5
        return self.first + min(max(share, 0.0), 1.0) * (self.last - self.first)

    def pixels(self, values: Floats) -> Floats:
        """The pixels of ``values [n]``."""
        return np.array([self.at(float(value)) for value in values])

    def ticks(self, about: int = 5) -> list[float]:
        """Round values on the scale, ``about`` as many as wanted."""
        step = _round_step((self.high - self.low) / about)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [i * step for i in range(first, last + 1)]


class LogScale(NamedTuple):
    """Like ``Scale``, with as many pixels from 1 to 2 as from 2 to 4: for ratios, all above 0."""

    low: float
    high: float
    first: float
    last: float

    def at(self, value: float) -> float:
        """The pixel of a ``value``; one beyond an end is put at the end."""
        ends = Scale(math.log(self.low), math.log(self.high), self.first, self.last)
        return ends.at(math.log(max(value, self.low)))

    def pixels(self, values: Floats) -> Floats:
        """The pixels of ``values [n]``."""
        return np.array([self.at(float(value)) for value in values])

    def ticks(self, about: int = 5) -> list[float]:
        """1, 2, 5, 10 … on the scale, or powers of ten alone if these are more than ``about``."""
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        steps = [factor * 10.0**power for power in powers for factor in (1.0, 2.0, 5.0)]
        shown = [value for value in steps if 0.999 * self.low <= value <= 1.001 * self.high]
        rare = [value for value in shown if f"{value:e}"[0] == "1"]
        return rare if len(shown) > about and len(rare) > 1 else shown


class WideScale(NamedTuple):
    """Like ``Scale`` from -100 to 100 and like ``LogScale`` beyond, for per cents that may be large."""

    low: float
    high: float
    first: float
    last: float

    def at(self, value: float) -> float:
        """The pixel of a ``value``; one beyond an end is put at the end."""
        return Scale(_widened(self.low), _widened(self.high), self.first, self.last).at(_widened(value))

    def ticks(self, about: int = 5) -> list[float]:
        """0, powers of ten and then 5 and 2 times these, where their labels do not meet."""
        largest = math.floor(math.log10(max(abs(self.low), abs(self.high), 10.0)))
        steps = [factor * 10.0**power for factor in (1, 5, 2) for power in range(largest, -1, -1)]
        room, shown = 0.6 * abs(self.last - self.first) / about, [0.0] if self.low <= 0.0 <= self.high else []
        for value in (sign * step for step in steps for sign in (1.0, -1.0)):
            is_apart = all(abs(self.at(value) - self.at(other)) >= room for other in shown)
            if self.low <= value <= self.high and is_apart:
                shown.append(value)
        return sorted(shown)


Axis = Scale | LogScale | WideScale


def span(values: Iterable[float], margin: float = 0.05) -> tuple[float, float]:
    """Ends of an axis for ``values``, beyond them by the share ``margin`` of their range."""
    finite = [value for value in values if math.isfinite(value)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = margin * (high - low) if high > low else 0.5 * abs(high) or 0.5
    return low - room, high + room


def short(value: float) -> str:
    """The number at a tick, as short as it goes."""
    for unit, size in (("M", 1e6), ("k", 1e3)):
        if abs(value) >= 10.0 * size or (abs(value) >= size and unit == "M"):
            return f"{value / size:.3g} {unit}"
    return f"{value:.6g}".replace("-", "−")


def _widened(value: float) -> float:
    """A ``value`` in hundreds, of which those beyond 1 grow like logarithms."""
    hundreds = abs(value) / 100.0
    return math.copysign(hundreds if hundreds <= 1.0 else 1.0 + math.log(hundreds), value)


def _round_step(step: float) -> float:
    """The nearest of 1, 2, 5, 10 … times a power of ten."""
    if not step > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    steps = [factor * power for factor in (1.0, 2.0, 5.0, 10.0)]
    return min(steps, key=lambda each: abs(math.log(each / step)))


def _written(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.2f}".rstrip("0").rstrip(".")
    return str(escape(value))
