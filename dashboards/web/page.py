"""A page: a template, its values, and the charts on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dashboards.web.charts import Chart

if TYPE_CHECKING:
    from dashboards.web.data_reader import DataReader
    from dashboards.web.parameters import Parameters


@dataclass(frozen=True)
class Page:
    """What answers a request."""

    template: str
    title: str
    tab: str = ""  # of the navigation
    run: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
    charts: Sequence[Chart] = ()
    library: str = ""  # that the page is of, if it is not of a run


PageOf = Callable[["DataReader", "Parameters"], Page]  # from the data and what the address asks for


def menu(name: str, title: str, options: Mapping[str, str] | Sequence[str], value: str) -> dict[str, Any]:
    """A menu of a form, for the template's macro of that name.

    Args:
        name: name of the parameter.
        title: title of the menu.
        options: values, with their titles if these differ.
        value: the one that is chosen.
    """
    titles = options if isinstance(options, Mapping) else {option: option for option in options}
    return {"name": name, "title": title, "options": list(titles.items()), "value": value}
