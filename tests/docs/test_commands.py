"""Every command in the documentation is one that its program accepts: the command exists, and its options do.

Those of the tutorial are run (``test_tutorial``); here they are only parsed.
"""

from __future__ import annotations

import importlib.util
import re
import shlex
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from flows import deployments
from flows.cli.main import app

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK: Final = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
HERE_DOCUMENT: Final = re.compile(r"<<(\w+)\n.*?^\1$", re.MULTILINE | re.DOTALL)
FOR_ALL: Final = {"--json", "--quiet", "--verbose"}  # which the command itself does not see
ELSEWHERE: Final = {  # programs that are not ours to check
    "apt-get", "runuser", "export", "mkdir", "openssl", "chown", "chmod", "cat", "curl", "jq",
    "docker", "pip",
}  # fmt: skip


def _commands(page: Path) -> list[list[str]]:
    """The commands of a page as words, without variables that are set for one command and without pipes."""
    found = []
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        lines = HERE_DOCUMENT.sub("", block).replace("\\\n", " ").splitlines()
        for words in (shlex.split(line, comments=True) for line in lines):
            for program in _split(words, ("|", "&&")):
                while program and re.fullmatch(r"[A-Z_]+=.*", program[0]):
                    program = program[1:]
                if program:
                    found.append(program)
    return found


def _split(words: Sequence[str], between: Sequence[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    for word in words:
        if word in between:
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def _motion_memory(words: list[str]) -> None:
    app.parse_args([word for word in words if word not in FOR_ALL], exit_on_error=False, print_error=False)


def _prefect(words: list[str]) -> None:
    from prefect.cli._app import _app

    words = [word for word in words if word != "--no-prompt"]  # of the program, before its commands
    _app.parse_args(words, exit_on_error=False, print_error=False)
    if words[:2] == ["deployment", "run"]:
        _deployment(words[2], [b for a, b in pairwise(words) if a == "-p"])


def _deployment(name: str, parameters: list[str]) -> None:
    """Check that a deployment is there, and that it takes parameters."""
    entries = yaml.safe_load((ROOT / "prefect.yaml").read_text(encoding="utf-8"))["deployments"]
    flows = {}
    for entry in entries:
        flow = getattr(deployments, entry["entrypoint"].rsplit(".", 1)[1])
        flows[f"{flow.name}/{entry['name']}"] = flow
    given = {parameter.partition("=")[0] for parameter in parameters}
    assert given <= set(flows[name].parameters.properties)


def _click(group: Any, words: list[str]) -> None:
    """Parse words as a program of Click does, which raises for what it does not know; nothing is run."""
    import click

    context = click.Context(group)
    while isinstance(group, click.Group):
        name, group, words = group.resolve_command(context, words)
        assert name is not None
        context = click.Context(group, parent=context, info_name=name)
    group.make_context(context.info_name, words)


def _mlflow(words: list[str]) -> None:
    from mlflow.cli import cli

    _click(cli, words)


def _dask(words: list[str]) -> None:
    from distributed.cli import dask_scheduler, dask_worker

    _click({"scheduler": dask_scheduler, "worker": dask_worker}[words[0]].main, words[1:])


def _python(words: list[str]) -> None:
    assert words[0] == "-m"
    assert importlib.util.find_spec(words[1]) is not None


def _make(words: list[str]) -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(words) <= set(targets)


PROGRAMS: Final[dict[str, Callable[[list[str]], None]]] = {
    "motion-memory": _motion_memory, "prefect": _prefect, "mlflow": _mlflow, "dask": _dask,
    "python": _python, "make": _make,
}  # fmt: skip
WITH_COMMANDS: Final = [page for page in PAGES if _commands(page)]


@pytest.mark.filterwarnings("ignore")  # of these programs among themselves
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=[str(page.relative_to(ROOT)) for page in WITH_COMMANDS])
def test_each_command_is_accepted_by_its_program(page: Path) -> None:
    for program, *words in _commands(page):
        if program in PROGRAMS:
            PROGRAMS[program](words)
        else:
            assert program in ELSEWHERE, f"{program} is not checked; say in this test how"


@pytest.mark.parametrize(
    "words",
    [
        ["motion-memory", "run", "--presets", "smoke"],
        ["motion-memory", "run", "--preset", "huge"],
        ["prefect", "work-pool", "create", "local", "--concurrency-limits", "1"],
        ["prefect", "deployment", "run", "run/nowhere"],
        ["prefect", "deployment", "run", "run/smoke", "-p", "experience=3"],
        ["dask", "worker", "--threads", "1"],
        ["python", "-m", "tests.nothing"],
        ["make", "nothing"],
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_command_that_its_program_would_refuse_is_found(words: list[str]) -> None:
    with pytest.raises(Exception):  # noqa: B017, PT011  # each program has its own
        PROGRAMS[words[0]](words[1:])


def test_the_page_of_commands_names_each_of_them_and_no_option_that_it_does_not_take() -> None:
    """Options may be missing there: the page refers to ``--help``."""
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    table = page.partition("| command | does |\n|---|---|\n")[2].partition("\n\n")[0]
    usages = [usage for row in table.splitlines() for usage in re.findall("`([^`]+)`", row.split(" | ")[0])]
    assert {usage.split()[0] for usage in usages} == {name for name in app if not name.startswith("-")}
    for usage in usages:
        name = usage.split()[0]
        taken = {option for argument in app[name].assemble_argument_collection() for option in argument.names}
        assert set(re.findall("--[a-z-]+", usage)) <= taken, usage
