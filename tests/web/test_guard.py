"""The guard over HTTP: only this machine, only our own page, and headers on everything."""

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.testclient import TestClient

from vqa_state.web.security import WILDCARDS, LocalGuard


def client(*hosts: str) -> TestClient:
    async def answer(_request: Request) -> Response:
        return PlainTextResponse("ok", headers={"X-Frame-Options": "ALLOW"})

    paths = ("/", "/projects/a/report.html")
    app = Starlette(
        routes=[Route(path, answer, methods=["GET", "POST", "DELETE"]) for path in paths]
    )
    return TestClient(LocalGuard(app, hosts), base_url="http://127.0.0.1:7860")


@pytest.mark.parametrize("host", ["127.0.0.1:7860", "localhost:7860", "localhost", "[::1]:7860"])
def test_this_machine_may_ask(host: str) -> None:
    assert client().get("/", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:7860", "", "10.0.0.7"])
def test_a_foreign_host_is_refused(host: str) -> None:
    reply = client().get("/", headers={"Host": host})
    assert reply.status_code == 403
    assert "refused" in reply.text


def test_a_host_given_at_the_start_is_ours() -> None:
    assert client("10.0.0.7").get("/", headers={"Host": "10.0.0.7:7860"}).status_code == 200


@pytest.mark.parametrize("wildcard", WILDCARDS)
def test_open_to_all_means_every_number_but_no_name(wildcard: str) -> None:
    for host, status in (("10.0.0.7:7860", 200), ("[fe80::1]:7860", 200), ("evil.example", 403)):
        assert client(wildcard).get("/", headers={"Host": host}).status_code == status


def test_another_site_may_lead_to_the_page_but_not_to_its_files() -> None:
    headers = {"Sec-Fetch-Site": "cross-site"}
    assert client().get("/", headers=headers).status_code == 200
    assert client().get("/projects/a/report.html", headers=headers).status_code == 403
    assert client().get("/projects/a/report.html").status_code == 200


@pytest.mark.parametrize("method", ["POST", "DELETE"])
@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:9999"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_a_write_from_another_site_is_refused(method: str, headers: dict[str, str]) -> None:
    assert client().request(method, "/", headers=headers).status_code == 403


@pytest.mark.parametrize(
    "headers",
    [{}, {"Origin": "http://127.0.0.1:7860"}, {"Sec-Fetch-Site": "same-origin"}],
)
def test_our_own_page_may_write(headers: dict[str, str]) -> None:
    assert client().post("/", headers=headers).status_code == 200


@pytest.mark.parametrize("host", ["127.0.0.1:7860", "evil.example"])
def test_every_reply_carries_the_headers_once(host: str) -> None:
    reply: httpx.Response = client().get("/", headers={"Host": host})
    assert reply.headers["x-content-type-options"] == "nosniff"
    assert reply.headers["referrer-policy"] == "no-referrer"
    assert reply.headers.get_list("x-frame-options") == ["SAMEORIGIN"]
    policy = reply.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "http" not in policy
