"""The web application: addresses, answers, what is refused, and what a page says when something is wrong."""

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

from dashboards.web.chart_files import csv_file, svg_file
from dashboards.web.notices import MissingError, NoticeError, WrongQuestionError
from dashboards.web.page import Page, PageOf
from dashboards.web.pages.comparison_page import comparison
from dashboards.web.pages.memory_page import memory
from dashboards.web.pages.overview_page import overview
from dashboards.web.pages.problem_page import problem
from dashboards.web.pages.problems_page import problems
from dashboards.web.pages.progress_page import progress
from dashboards.web.pages.runs_page import runs
from dashboards.web.pages.try_it_page import check_world, plan_world, try_it
from dashboards.web.policy import Policy
from dashboards.web.query import Asked, link
from dashboards.web.retrained import Retrainings
from dashboards.web.site import Site
from storage.errors import StorageError
from storage.fields import parse_json
from storage.places.data_folder import DataFolder

LARGEST_BODY_BYTES: Final = 1 << 20
PAGES: Final[dict[str, PageOf]] = {
    "/": runs,
    "/runs/{run}": overview,
    "/runs/{run}/problems": problems,
    "/runs/{run}/problem": problem,
    "/runs/{run}/memory": memory,
    "/runs/{run}/try": try_it,
    "/progress": progress,
    "/compare": comparison,
}
ANSWERS: Final[dict[str, Callable[[Site, Asked, Any], dict[str, Any]]]] = {
    "/runs/{run}/check": check_world,
    "/runs/{run}/plan": plan_world,
}
TABS: Final = ("Overview", "Problems", "Memory", "Try it", "Progress", "Compare")
_KINDS: Final = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_FILE_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; sandbox"


def dashboard_app(data: DataFolder, retrainings: Retrainings = tuple) -> Starlette:
    """The application over a data folder, and what the registry knows of it; it writes nothing."""
    site = Site(data, retrainings)
    routes = [Route(path, _page_endpoint(site, page)) for path, page in PAGES.items()]
    routes += [
        Route(path, _answer_endpoint(site, answer), methods=["POST"]) for path, answer in ANSWERS.items()
    ]
    routes.append(Route("/static/{name}", _static))
    return Starlette(
        routes=routes,
        middleware=[Middleware(Policy), Middleware(GZipMiddleware, minimum_size=2000)],
        exception_handlers={HTTPException: _http_error, Exception: _bug},
    )


def rendered(page: Page, status: int = 200, asked: Asked | None = None) -> Response:
    """A page as HTML."""

    def chart_address(name: str, kind: str) -> str:
        return asked.also(**{"as": kind, "chart": name}) if asked else ""

    values = {"page": page, "tabs": _tabs(page.run), "chart_address": chart_address, **page.values}
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


def _tabs(run: str) -> list[tuple[str, str]]:
    """Names and addresses of the pages, those of a run only where there is one."""
    base = f"/runs/{run}"
    of_run = {
        "Overview": base,
        "Problems": f"{base}/problems",
        "Memory": f"{base}/memory",
        "Try it": f"{base}/try",
    }
    wherever = {
        "Progress": link("/progress", {"run": run}),
        "Compare": link("/compare", {"run": run, "other": run}),
    }
    return [(name, place) for name, place in ((of_run if run else {}) | wherever).items()]


def _page_endpoint(site: Site, page_of: PageOf) -> Callable[[Request], Response]:
    def endpoint(request: Request) -> Response:
        try:
            asked = _asked(request)
            wanted = asked.one_of("as", ("page", "svg", "csv"), "page")
            page = page_of(site, asked)
            return rendered(page, 200, asked) if wanted == "page" else _file(page, asked, wanted)
        except (NoticeError, StorageError) as error:
            return _notice(error, request.path_params.get("run", ""))

    return endpoint


def _file(page: Page, asked: Asked, kind: str) -> Response:
    """A chart of a page as a file."""
    name = asked.text("chart")
    chart = next((each for each in page.charts if each.name == name), None)
    if chart is None:
        raise MissingError(f"This page has no chart {name[:60]!r}.")
    content, media = (svg_file(chart), "image/svg+xml") if kind == "svg" else (csv_file(chart), "text/csv")
    said = "-".join(part for part in (page.run, chart.name) if part)
    headers = {
        "Content-Disposition": f'attachment; filename="{said}.{kind}"',
        "Content-Security-Policy": _FILE_POLICY,
    }
    return Response(content, media_type=f"{media}; charset=utf-8", headers=headers)


def _answer_endpoint(
    site: Site, answer: Callable[[Site, Asked, Any], dict[str, Any]]
) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        try:
            asked, content = _asked(request), await _content(request)
            return JSONResponse(await run_in_threadpool(answer, site, asked, content))
        except NoticeError as error:
            return JSONResponse({"error": str(error)}, error.status)
        except StorageError as error:
            return JSONResponse({"error": str(error)}, NoticeError.status)

    return endpoint


async def _content(request: Request) -> Any:
    """The JSON of a request that the dashboard's own page sent."""
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        raise WrongQuestionError("Send JSON, with the content type application/json.")
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > LARGEST_BODY_BYTES:
            raise WrongQuestionError(f"A world takes at most {LARGEST_BODY_BYTES >> 20} MB; this is more.")
    try:
        return parse_json(bytes(body), "The world")
    except StorageError as error:
        raise WrongQuestionError(str(error)) from None


def _asked(request: Request) -> Asked:
    return Asked(request.url.path, dict(request.query_params), request.path_params.get("run", ""))


def _static(request: Request) -> Response:
    """A file of the application itself; nothing else is in the list."""
    name = request.path_params["name"]
    content = _static_files().get(name)
    if content is None:
        raise HTTPException(404)
    kind = _KINDS[Path(name).suffix]
    return Response(content, media_type=f"{kind}; charset=utf-8", headers={"Cache-Control": "max-age=60"})


@functools.cache
def _static_files() -> dict[str, bytes]:
    folder = files("dashboards.web").joinpath("static")
    return {each.name: each.read_bytes() for each in folder.iterdir() if Path(each.name).suffix in _KINDS}


def _notice(error: Exception, run: str = "") -> Response:
    """A page that says what is the matter."""
    status = getattr(error, "status", NoticeError.status)
    title = getattr(error, "title", "The data cannot be read")
    known = run if status not in (404,) else ""
    values = {"message": str(error), "status": status}
    return rendered(Page("notice.html.jinja", title, run=known, values=values), status)


def _http_error(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 500
    said = {
        404: ("Not found", "There is no page at this address."),
        405: ("Not allowed", "This address cannot be asked in this way."),
    }.get(status, ("This cannot be answered", "The request makes no sense here."))
    page = Page("notice.html.jinja", said[0], values={"message": said[1], "status": status})
    return rendered(page, status)


def _bug(request: Request, error: Exception) -> Response:
    """A bug: the terminal has the trace, the page says so."""
    message = "The dashboard has a fault here. What happened is written where it was started."
    return rendered(Page("notice.html.jinja", "Fault", values={"message": message, "status": 500}), 500)
