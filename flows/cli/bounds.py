"""The bounds of numbers that options may have, as Prefect checks them before a run begins.

Commands check the same bounds themselves, with words of their own.
"""

from __future__ import annotations

import inspect
import sys
from copy import copy
from functools import reduce
from operator import or_
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Final, get_args, get_origin

from annotated_types import Ge, Interval

if TYPE_CHECKING:
    from prefect import Flow

_LARGEST: Final = sys.float_info.max  # every number but infinity is at most that
_USUAL: Final = {int: Ge(1)}  # most whole numbers count something
_OF_NAME: Final = {
    "seed": Ge(0),
    "poses": Interval(ge=0.0, le=1.0),
    **dict.fromkeys(
        ("learning_rate", "margin", "time_limit", "scale", "resolution", "goal_radius"),
        Interval(gt=0.0, le=_LARGEST),
    ),
    **dict.fromkeys(("origin_weight", "tolerance", "improve_seconds"), Interval(ge=0.0, le=_LARGEST)),
}


def bounded(name: str, annotation: Any) -> Any:
    """The type of an option, with bounds for the numbers in it.

    Args:
        name: of the option.
        annotation: its type: a number, a list of such, or a choice between them.
    """
    if annotation in (int, float):
        bounds = _OF_NAME.get(name, _USUAL.get(annotation))
        return annotation if bounds is None else Annotated[annotation, bounds]
    if get_origin(annotation) is list:
        return list[bounded(name, *get_args(annotation))]  # type: ignore[misc]  # made when it runs
    if get_origin(annotation) is UnionType:
        return reduce(or_, [bounded(name, each) for each in get_args(annotation)])
    return annotation


def bounded_flow(flow: Flow[..., Any]) -> Flow[..., Any]:
    """A copy of a ``flow`` for whose parameters Prefect knows the bounds."""
    from prefect.utilities.callables import parameter_schema  # late: Prefect reads its environment

    signature = inspect.signature(flow.fn, eval_str=True)
    parameters = [
        each.replace(annotation=bounded(each.name, each.annotation)) for each in signature.parameters.values()
    ]
    changed = copy(flow)
    changed.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]  # read below
    changed.parameters = parameter_schema(changed)
    return changed
