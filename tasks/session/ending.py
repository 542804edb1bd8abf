"""How a flow that Prefect started ends if it cannot do its work: in a state that says why in one line.

Commands report errors themselves. A flow that a schedule, an event or ``prefect deployment run`` starts has
only its state in Prefect and its log, where a traceback would hide the reason.
"""

from __future__ import annotations

import functools
import inspect
import logging
from collections.abc import Callable
from copy import copy
from typing import Any, Final, ParamSpec, TypeVar

from prefect import Flow
from prefect.client.schemas.objects import State
from prefect.states import Cancelled, Failed

from storage.errors import InUseError, StorageError
from tasks.settings.errors import RunError, UsageError, one_line

EXPECTED: Final = (UsageError, RunError, StorageError, OSError)  # their messages say everything
SKIPPED: Final = "Skipped"  # the state of a flow whose data folder another one uses

Given = ParamSpec("Given")
Result = TypeVar("Result")

_LOG = logging.getLogger(__name__)


def ended_in_one_line(body: Callable[Given, Result]) -> Callable[Given, Result | State[Any]]:
    """Decorate the function of a flow: an expected error becomes its last state, with one line as message.

    A flow that finds its data folder in use is skipped, which counts as cancelled: what it would have done is
    left to the next one. All other expected errors fail it. Errors that nobody expected are logged in a line
    and raised, so that Prefect logs where in the code they arose.
    """

    @functools.wraps(body)
    def ended(*args: Given.args, **given: Given.kwargs) -> Result | State[Any]:
        try:
            return body(*args, **given)
        except InUseError as error:
            _LOG.warning("skipped: %s", one_line(error))
            return Cancelled(name=SKIPPED, message=one_line(error))
        except EXPECTED as error:
            _LOG.error("motion-memory: %s", one_line(error))
            return Failed(message=one_line(error))
        except Exception as error:
            _LOG.error("motion-memory: %s: %s", type(error).__name__, one_line(error))
            raise

    # with types for names, which Prefect would look up in this module
    ended.__signature__ = inspect.signature(body, eval_str=True)  # type: ignore[attr-defined]  # as Python reads
    return ended


def started_by_prefect(flow: Flow[..., Any]) -> Flow[..., Any]:
    """A copy of a ``flow`` that ends as ``ended_in_one_line`` says; commands call the flow itself."""
    changed = copy(flow)
    changed.fn = ended_in_one_line(flow.fn)
    return changed
