"""A page: what a template says with which values, and the charts on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dashboards.web.charts import Chart

if TYPE_CHECKING:
    from dashboards.web.query import Asked
    from dashboards.web.site import Site


@dataclass(frozen=True)
class Page:
    """What answers an address."""

    template: str
    title: str
    tab: str = ""  # of the navigation
    run: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
    charts: Sequence[Chart] = ()


PageOf = Callable[["Site", "Asked"], Page]
