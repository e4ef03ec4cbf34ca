"""The app's own routes: pictures in and out, labels, verdicts on a picture, recognizer files.

They stand beside gradio's, which keep every upload twice, serve what they are given and are
slower than a finger on the keys. Each argument may be anything; each is checked.
"""

from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from vqa_state.errors import NothingToSearchError, RecognizerError
from vqa_state.images.reading import MAX_BYTES
from vqa_state.project.split import Split
from vqa_state.report.page import report_page
from vqa_state.search.objectives import Objective
from vqa_state.study.latency import read_pace
from vqa_state.study.leaderboard import standings
from vqa_state.study.optimize import recognizer_path
from vqa_state.votes.rules import VoteKind
from vqa_state.web import arguments, try_recognizer
from vqa_state.web.recognizer_choice import Taken, found_and_assessed, taken_from, taken_recognizer
from vqa_state.web.session import Desk
from vqa_state.web.uploads import added_lines, with_breaths

__all__ = ["MAX_UPLOAD", "explain", "routes"]

MAX_UPLOAD = 500_000_000
"""Bytes of one file, that is of a ZIP; each picture has its own, lower limit."""

MAX_JSON = 2_000_000
PAPER = VoteKind.PAPER.value
IMAGE_TYPES = {
    "jpg": "image/jpeg",
    "png": "image/png",
    "webp": "image/webp",
    "bmp": "image/bmp",
    "heic": "image/heic",
}
PICTURE_HEADERS = {"Cache-Control": "private, max-age=31536000, immutable"}  # ids are hashes


def routes(desk: Desk) -> APIRouter:
    """All routes, for the projects on this desk."""
    router = APIRouter(prefix="/projects/{pid}")

    @router.post("/upload")
    async def upload(request: Request, pid: str, name: str) -> Response:
        try:
            data = await _body(request, MAX_UPLOAD)
        except ClientDisconnect:  # stopped, or the page was left
            return Response(status_code=400)
        lines = with_breaths(added_lines(desk, pid, name, data))
        return StreamingResponse(lines, media_type="application/x-ndjson")

    @router.post("/marks")
    async def marks(request: Request, pid: str) -> Response:
        marked = arguments.json_object(await _body(request, MAX_JSON))
        return await _json(lambda: _mark(desk, pid, marked))

    @router.post("/remove")
    async def remove(request: Request, pid: str) -> Response:
        wanted = arguments.json_object(await _body(request, MAX_JSON))
        return await _json(lambda: _remove(desk, pid, wanted))

    @router.post("/recognize/{objective}")
    async def recognize(
        request: Request,
        pid: str,
        objective: str,
        vote: str = PAPER,
        coverage: str = "1",
        early: str = "",
        all: str = "",  # noqa: A002  # a word of the address
    ) -> Response:
        data = await _body(request, MAX_BYTES)
        taken = _taken(vote, coverage, early, all)
        return await _json(lambda: try_recognizer.of_picture(desk, pid, objective, data, taken))

    @router.get("/thumbs/{image_id}")
    def thumb(pid: str, image_id: str) -> Response:
        with desk.reading(pid) as project:
            data = project.thumbnail(arguments.known_image(project, image_id).id)
        return Response(data, media_type="image/webp", headers=PICTURE_HEADERS)

    @router.get("/images/{image_id}")
    def image(pid: str, image_id: str) -> Response:
        with desk.reading(pid) as project:
            found = arguments.known_image(project, image_id)
            data = project.read(found)
        return Response(data, media_type=IMAGE_TYPES[found.suffix], headers=PICTURE_HEADERS)

    @router.get("/recognizers/{objective}.json")
    def recognizer(
        pid: str,
        objective: str,
        vote: str = PAPER,
        coverage: str = "1",
        all: str = "",  # noqa: A002  # a word of the address
    ) -> Response:
        return _download(desk, pid, objective, _taken(vote, coverage, "", all))

    @router.get("/report.html")
    def report(pid: str) -> Response:
        return _report(desk, pid)

    return router


async def explain(request: Request, error: Exception) -> Response:
    """A known error as JSON: its sentence, under a status that says whose fault it is."""
    if isinstance(error, arguments.TooLargeError):
        status = 413
    else:
        status = 404 if request.method == "GET" else 400
    return JSONResponse({"error": str(error)}, status_code=status)


async def _body(request: Request, limit: int) -> bytes:
    """The request's body; more than `limit` bytes are refused before they are all here."""
    chunks, size = [], 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > limit:
            raise arguments.TooLargeError(
                f"this is larger than {limit / 1e6:.0f} MB, the most that is read; make it smaller"
            )
        chunks.append(chunk)
    return b"".join(chunks)


async def _json(work: Callable[[], Mapping[str, Any]]) -> Response:
    """What `work` gives, made beside the event loop: pictures take time."""
    return JSONResponse(await run_in_threadpool(work))


def _mark(desk: Desk, pid: str, marked: Mapping[str, Any]) -> dict[str, Any]:
    labels = arguments.json_object(marked.get("labels", {}))
    splits = arguments.json_object(marked.get("splits", {}))
    accepted = arguments.json_object(marked.get("accepted", {}))
    with desk.changing(pid) as project:
        for image_id, label in labels.items():
            known = arguments.known_image(project, image_id).id
            from_a_vote = accepted.get(image_id, False) is not False
            project.set_labels([known], _label(label), accepted=from_a_vote)
        for image_id, split in splits.items():
            side = None if split is None else arguments.choice(split, Split, "the side")
            project.set_splits([arguments.known_image(project, image_id).id], side)
    return {}


def _label(value: object) -> int | None:
    if value is None or (type(value) is int and value in (-1, 1)):
        return value
    raise arguments.RequestError("a label must be 1, -1 or null")


def _remove(desk: Desk, pid: str, wanted: Mapping[str, Any]) -> dict[str, Any]:
    with desk.changing(pid) as project:
        ids = [
            arguments.known_image(project, one).id for one in arguments.image_ids(wanted.get("ids"))
        ]
        project.remove(dict.fromkeys(ids))
    return {}


def _taken(vote: str, coverage: str, early: str, of_all: str) -> Taken:
    try:
        share = float(coverage)
    except ValueError as error:
        raise arguments.RequestError("the coverage must be a number above 0, at most 1") from error
    if not {early, of_all} <= {"", "1"}:
        raise arguments.RequestError("early and all must be 1 or nothing")
    return taken_from(vote, share, early == "1", of_all == "1")


def _download(desk: Desk, pid: str, objective: str, taken: Taken) -> Response:
    chosen = arguments.choice(objective, Objective, "the objective")
    project = desk.snapshot(pid)
    path = recognizer_path(project, chosen)
    if taken.plain:
        try:
            data = path.read_bytes()
        except FileNotFoundError as error:
            raise RecognizerError("there is no recognizer yet; optimize first") from error
    else:
        data = taken_recognizer(project, chosen, taken).to_bytes()
    name = "all_questions.json" if taken.all_questions else path.name
    return _attachment(data, "application/json", name, f"{project.name} {name}")


def _report(desk: Desk, pid: str) -> Response:
    """The page that prints. It shows test scores, so it counts as a look."""
    project = desk.snapshot(pid)
    found, assessed = found_and_assessed(project)
    if found is None:
        raise NothingToSearchError("there is nothing to report yet; optimize first")
    table = standings(project.chosen, found, assessed, read_pace(project))
    page = report_page(project, found, assessed, table).encode()
    if found.test is not None:
        with desk.changing(pid) as changed:
            changed.test_looks += 1
    return _attachment(page, "text/html", "report.html", f"{project.name} report.html")


def _attachment(data: bytes, media_type: str, plain: str, shown: str) -> Response:
    """A file to keep. Two names, because a plain one holds ASCII only (RFC 6266)."""
    kept = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(shown, safe='')}"
    headers = {"Content-Disposition": kept, "Cache-Control": "no-store"}
    return Response(data, media_type=media_type, headers=headers)
