"""The flows as Prefect deploys them: each takes the options of its command, checked by the same rules.

``prefect deployment run run/laptop -p experiences=10`` does what ``motion-memory run --experiences 10`` does,
and Prefect's form shows the options with their choices. The deployment decides about workers and servers.
"""

from __future__ import annotations

import inspect
import logging
import os
from collections.abc import Callable
from dataclasses import fields
from functools import reduce
from operator import or_
from pathlib import Path
from types import NoneType
from typing import Any, Final, get_args, get_type_hints

from prefect import Flow
from prefect.utilities.callables import parameter_schema
from pydantic_core import MISSING

from flows.benchmark import benchmark as benchmark_flow
from flows.build_memory import build_memory as build_memory_flow
from flows.cli import library_commands, map_commands, problem_commands
from flows.cli.bounds import bounded
from flows.cli.run_options import Options
from flows.cli.stage_commands import settings_of
from flows.collect import collect as collect_flow
from flows.continual import continual as continual_flow
from flows.experience_curve import experience_curve as experience_curve_flow
from flows.hallucinate import hallucinate as hallucinate_flow
from flows.judge import judge as judge_flow
from flows.report import report as report_flow
from flows.retrain import retrain as retrain_flow
from flows.run import run as run_flow
from flows.sweep import sweep as sweep_flow
from flows.train import train as train_flow
from tasks.servers.access import auth_environment
from tasks.session.ending import ended_in_one_line
from tasks.session.folder_lock import locked_folder

_KEYWORD: Final = inspect.Parameter.KEYWORD_ONLY
_ELSEWHERE: Final = ("workers", "scheduler")  # options of a command that a deployment sets in its own way
_ABOUT: Final = (
    "preset",
    "classes",
    "worlds",
    "sources",
    "problem",
    "path",
    "planner",
)  # parameters that name a run


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, _KEYWORD, annotation=bounded(name, annotation), default=default)


def _options_of(kind: type) -> list[inspect.Parameter]:
    """The fields of a class of options as parameters."""
    types = get_type_hints(kind)
    return [_parameter(each.name, types[each.name], each.default) for each in fields(kind)]


def _flow_of(
    name: str, task_runner: Any, body: Callable[..., None], parameters: list[inspect.Parameter], told: str
) -> Flow[..., Any]:
    """A flow whose ``body`` is called with these parameters; ``told`` is its docstring."""

    @ended_in_one_line
    def deployed(**given: Any) -> None:
        body(**given)

    deployed.__name__ = name.replace("-", "_")
    deployed.__doc__ = told
    deployed.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # read by Prefect
    flow = Flow(deployed, name=name, task_runner=task_runner, flow_run_name=_run_name)
    flow.__signature__ = inspect.Signature([*map(_in_form, parameters)])  # type: ignore[attr-defined]  # as above
    flow.parameters = parameter_schema(flow)
    return flow


def _in_form(parameter: inspect.Parameter) -> inspect.Parameter:
    """A parameter for the form: an optional field instead of a choice between a value and None."""
    if parameter.default is not None:
        return parameter
    kinds = [each for each in get_args(parameter.annotation) if each is not NoneType]
    return parameter.replace(annotation=reduce(or_, kinds) | MISSING, default=MISSING)


def _run_name() -> str:
    """The name of a run in Prefect: its flow, its main parameters and its seed."""
    from prefect.runtime import flow_run

    given = flow_run.parameters
    about = [_short(given[name]) for name in _ABOUT if given.get(name)]
    return " ".join([str(flow_run.flow_name), *about, f"seed {given.get('seed')}"])


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " ".join(_short(each) for each in value)
    return Path(value).name if isinstance(value, Path) else str(value)


def _stage(flow: Flow[..., None]) -> Flow[..., Any]:
    """A flow that takes settings and a data folder, with the options of a run instead of these."""
    own = [
        _parameter(each.name, each.annotation, each.default)
        for each in inspect.signature(flow.fn, eval_str=True).parameters.values()
        if each.name not in ("settings", "data", *_ELSEWHERE)
    ]
    options = [each for each in _options_of(Options) if each.name not in _ELSEWHERE]

    def body(**given: Any) -> None:
        _prepare()
        further = {each.name: given.pop(each.name) for each in own}
        chosen = Options(**given)
        with locked_folder(chosen.folder) as folder:
            flow.fn(settings_of(chosen), folder.place, **further)

    return _flow_of(flow.name, flow.task_runner, body, [*options, *own], _told(flow.fn, Options))


def _command(command: Callable[..., int | None]) -> Flow[..., Any]:
    """A command for the user's own problems or maps as a flow; each option becomes a parameter."""
    types = get_type_hints(command)
    own: list[inspect.Parameter] = []
    groups: dict[str, list[inspect.Parameter]] = {}  # options that the command takes as one object
    parameters = inspect.signature(command).parameters.values()
    only_by_place = [each.name for each in parameters if each.kind is each.POSITIONAL_ONLY]
    for each in parameters:
        if hasattr(types[each.name], "__dataclass_fields__"):
            groups[each.name] = _options_of(types[each.name])
        else:
            own.append(_parameter(each.name, types[each.name], each.default))

    def body(**given: Any) -> None:
        _prepare()
        values = {
            name: types[name](**{each.name: given.pop(each.name) for each in options})
            for name, options in groups.items()
        }
        first = [given.pop(name) for name in only_by_place]
        command(*first, **given, **values)

    flat = [*own, *(each for options in groups.values() for each in options)]
    told = _told(command, *(types[name] for name in groups))
    return _flow_of(command.__name__.replace("_", "-"), None, body, flat, told)


def _prepare() -> None:
    """Do what a command does before its flow: let MLflow's client find the password, and log notices.

    Prefect sends the lines of its extra loggers to the run's log, but leaves their level to the root logger.
    """
    for name, value in auth_environment().items():
        os.environ.setdefault(name, value)
    for room in ("tasks", "storage"):
        logging.getLogger(room).setLevel(logging.INFO)


def _told(function: Callable[..., Any], *options: type) -> str:
    """The docstring of a flow in the form that Prefect reads the descriptions of parameters from."""
    sections = [inspect.getdoc(each) or "" for each in (function, *options)]
    args = [each.partition("Args:\n")[2].rstrip() for each in sections]
    return "\n".join([sections[0].partition("Args:")[0].rstrip(), "", "Args:", *filter(None, args)])


run = _stage(run_flow)
collect = _stage(collect_flow)
hallucinate = _stage(hallucinate_flow)
train = _stage(train_flow)
build_memory = _stage(build_memory_flow)
benchmark = _stage(benchmark_flow)
report = _stage(report_flow)
judge = _stage(judge_flow)
continual = _stage(continual_flow)
experience_curve = _stage(experience_curve_flow)
sweep = _stage(sweep_flow)
retrain = _stage(retrain_flow)
plan = _command(problem_commands.plan)
solve = _command(problem_commands.solve)
import_worlds = _command(map_commands.import_worlds)
gather = _command(map_commands.gather)
retrain_library = _command(library_commands.retrain_library)
adapt = _command(map_commands.adapt)
route = _command(map_commands.route)
