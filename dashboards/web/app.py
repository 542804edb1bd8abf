"""The web application: addresses, answers, and what a page shows when something is wrong."""

from __future__ import annotations

import functools
from collections.abc import Awaitable, Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dashboards.palette import style_sheet
from dashboards.report.tables import as_csv
from dashboards.web.chart_file import svg_file
from dashboards.web.data_reader import DataReader
from dashboards.web.memory_versions import Versions
from dashboards.web.notices import BadRequestError, MissingError, NoticeError
from dashboards.web.page import Page, PageOf
from dashboards.web.pages.comparison_page import comparison
from dashboards.web.pages.memory_page import memory
from dashboards.web.pages.overview_page import overview
from dashboards.web.pages.problem_page import problem
from dashboards.web.pages.problems_page import problems
from dashboards.web.pages.progress_page import progress
from dashboards.web.pages.run_before import against_the_one_before
from dashboards.web.pages.runs_page import runs
from dashboards.web.pages.try_it_page import check_world, plan_world, try_it
from dashboards.web.parameters import Parameters, link
from dashboards.web.policy import Policy
from storage.errors import StorageError
from storage.fields import parse_json
from storage.places.data_folder import DataFolder

# from the data, the address and what was sent
Answer = Callable[[DataReader, Parameters, Any], dict[str, Any]]

LARGEST_BODY_BYTES: Final = 1 << 20
PAGES: Final[dict[str, PageOf]] = {
    "/": runs,
    "/runs/{run}": overview,
    "/runs/{run}/before": against_the_one_before,
    "/runs/{run}/problems": problems,
    "/runs/{run}/problem": problem,
    "/runs/{run}/memory": memory,
    "/runs/{run}/try": try_it,
    "/libraries/{library}/try": try_it,
    "/progress": progress,
    "/compare": comparison,
}
ANSWERS: Final[dict[str, Answer]] = {
    f"/{base}/{name}": answer
    for base in ("runs/{run}", "libraries/{library}")
    for name, answer in (("check", check_world), ("plan", plan_world))
}
_KINDS: Final = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_FILE_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; sandbox"


def dashboard_app(folder: DataFolder, versions: Versions = tuple) -> Starlette:
    """The application over a data ``folder`` and the ``versions`` in the registry; it writes nothing."""
    data = DataReader(folder, versions)
    return Starlette(
        routes=[
            *(Route(path, _page_endpoint(data, page)) for path, page in PAGES.items()),
            *(
                Route(path, _post_endpoint(data, answer), methods=["POST"])
                for path, answer in ANSWERS.items()
            ),
            Route("/static/{name}", _static),
        ],
        middleware=[Middleware(Policy), Middleware(GZipMiddleware, minimum_size=2000)],
        exception_handlers={HTTPException: _http_error, Exception: _bug},
    )


def rendered(page: Page, status: int = 200, params: Parameters | None = None) -> Response:
    """A ``page`` as HTML with an HTTP ``status``; its charts can be saved if there are ``params``."""

    def chart_address(name: str, kind: str) -> str:
        return params.also(**{"as": kind, "chart": name}) if params else ""

    values = {"page": page, "tabs": _tabs(page), "chart_address": chart_address, **page.values}
    html = _templates().get_template(page.template).render(values)
    return Response(html, status, media_type="text/html")


@functools.cache
def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("dashboards.web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _tabs(page: Page) -> dict[str, str]:
    """Addresses of the pages by name; those of a run or a library only if one is chosen."""
    run, chosen = page.run, {}
    if run:
        chosen = {"Overview": "", "Problems": "/problems", "Memory": "/memory", "Try it": "/try"}
    elif page.library:
        chosen = {"Try it": "/try"}
    base = f"/runs/{run}" if run else f"/libraries/{page.library}"
    return {name: f"{base}{path}" for name, path in chosen.items()} | {
        "Progress": link("/progress", {"run": run}),
        "Compare": link("/compare", {"run": run, "other": run}),
    }


def _page_endpoint(data: DataReader, page_of: PageOf) -> Callable[[Request], Response]:
    def endpoint(request: Request) -> Response:
        try:
            params = _parameters(request)
            kind = params.one_of("as", ("page", "svg", "csv"), "page")
            page = page_of(data, params)
            return rendered(page, 200, params) if kind == "page" else _file(page, params.text("chart"), kind)
        except (NoticeError, StorageError) as error:
            return _notice(error, request.path_params.get("run", ""))

    return endpoint


def _file(page: Page, name: str, kind: str) -> Response:
    """The chart of that name on a page as a file."""
    chart = next((chart for chart in page.charts if chart.name == name), None)
    if chart is None:
        raise MissingError(f"This page has no chart {name[:60]!r}.")
    content, media = (
        (svg_file(chart), "image/svg+xml") if kind == "svg" else (as_csv(chart.table), "text/csv")
    )
    file_name = "-".join(part for part in (page.run, chart.name) if part)
    headers = {
        "Content-Disposition": f'attachment; filename="{file_name}.{kind}"',
        "Content-Security-Policy": _FILE_POLICY,
    }
    return Response(content, media_type=f"{media}; charset=utf-8", headers=headers)


def _post_endpoint(data: DataReader, answer: Answer) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        try:
            params, content = _parameters(request), await _content(request)
            return JSONResponse(await run_in_threadpool(answer, data, params, content))
        except (NoticeError, StorageError) as error:
            return JSONResponse({"error": str(error)}, getattr(error, "status", NoticeError.status))

    return endpoint


async def _content(request: Request) -> Any:
    """The JSON that the dashboard's own page sent."""
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        raise BadRequestError("Send JSON, with the content type application/json.")
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > LARGEST_BODY_BYTES:
            raise BadRequestError(f"A world takes at most {LARGEST_BODY_BYTES >> 20} MB; this is more.")
    try:
        return parse_json(bytes(body), "The world")
    except StorageError as error:
        raise BadRequestError(str(error)) from None


def _parameters(request: Request) -> Parameters:
    run, library = (request.path_params.get(name, "") for name in ("run", "library"))
    return Parameters(request.url.path, dict(request.query_params), run, library)


def _static(request: Request) -> Response:
    """A file of the application itself, and no other."""
    name = request.path_params["name"]
    content = _static_files().get(name)
    if content is None:
        raise HTTPException(404)
    media = f"{_KINDS[Path(name).suffix]}; charset=utf-8"
    return Response(content, media_type=media, headers={"Cache-Control": "max-age=60"})


@functools.cache
def _static_files() -> dict[str, bytes]:
    folder = files("dashboards.web").joinpath("static")
    static = {file.name: file.read_bytes() for file in folder.iterdir() if Path(file.name).suffix in _KINDS}
    return static | {"colours.css": style_sheet().encode()}


def _notice(error: Exception, run: str = "") -> Response:
    """A page that says what is the matter."""
    status = getattr(error, "status", NoticeError.status)
    title = getattr(error, "title", "The data cannot be read")
    return _message(status, title, str(error), "" if status == 404 else run)


def _message(status: int, title: str, message: str, run: str = "") -> Response:
    values = {"message": message, "status": status}
    return rendered(Page("notice.html.jinja", title, run=run, values=values), status)


def _http_error(request: Request, error: Exception) -> Response:
    match status := error.status_code if isinstance(error, HTTPException) else 500:
        case 404:
            return _message(status, "Not found", "There is no page at this address.")
        case 405:
            return _message(status, "Not allowed", "This address does not take this kind of request.")
        case _:
            return _message(status, "This cannot be answered", "The request makes no sense here.")


def _bug(request: Request, error: Exception) -> Response:
    """A bug: the terminal shows the trace, the page says so."""
    return _message(500, "Fault", "The dashboard has a fault; the terminal that started it shows the trace.")
