"""The app's own routes over HTTP: what they do, and what they refuse."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from starlette.testclient import TestClient

from vqa_state.images.reading import content_hash
from vqa_state.recognizer.recognizer import read_recognizer
from vqa_state.web import routes
from vqa_state.web.security import LocalGuard
from vqa_state.web.server import build_api
from vqa_state.web.session import Desk

SVG = b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'
UNKNOWN = "0" * 64


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return TestClient(LocalGuard(build_api(desk)), base_url="http://127.0.0.1")


@pytest.fixture
def image_id(desk: Desk, pid: str) -> str:
    return next(iter(desk.snapshot(pid).images))


def png(color: str) -> bytes:
    data = io.BytesIO()
    Image.new("RGB", (40, 30), color).save(data, "PNG")
    return data.getvalue()


def upload(client: TestClient, pid: str, name: str, data: bytes) -> Any:
    reply = client.post(f"/projects/{pid}/upload", params={"name": name}, content=data)
    assert reply.status_code == 200, reply.text
    lines = [json.loads(line) for line in reply.text.splitlines()]
    assert lines[-1]["done"] <= lines[-1]["of"]
    return {
        field: [one for line in lines for one in line[field]]
        for field in ("added", "known", "refused")
    }


def marks(client: TestClient, pid: str, content: object) -> int:
    return client.post(f"/projects/{pid}/marks", content=json.dumps(content)).status_code


def test_a_picture_is_added_once(client: TestClient, desk: Desk, pid: str) -> None:
    first = upload(client, pid, "red.png", png("red"))
    assert [(row["name"], row["label"], row["split"]) for row in first["added"]] == [
        ("red.png", None, None)
    ]
    again = upload(client, pid, "copy.png", png("red"))
    assert again["added"] == []
    assert again["known"] == [{"name": "copy.png", "row": first["added"][0]}]
    assert first["added"][0]["id"] in Desk(desk.root).snapshot(pid).images  # it was saved


def test_a_zip_is_unpacked_and_its_folders_label(client: TestClient, pid: str) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("open/a.png", png("blue"))
        archive.writestr("closed/b.png", png("green"))
        archive.writestr("closed/evil.svg", SVG)
    report = upload(client, pid, "all.zip", packed.getvalue())
    assert [(row["name"], row["label"]) for row in report["added"]] == [
        ("open/a.png", 1),
        ("closed/b.png", -1),
    ]
    assert [one["name"] for one in report["refused"]] == ["closed/evil.svg"]


@pytest.mark.parametrize(
    ("name", "data"), [("a.jpg", b"just text"), ("a.png", SVG), ("a.svg", SVG), ("a.jpg", b"")]
)
def test_what_is_no_picture_is_refused_with_a_reason(
    client: TestClient, desk: Desk, pid: str, name: str, data: bytes
) -> None:
    before = desk.snapshot(pid).images
    report = upload(client, pid, name, data)
    assert report["refused"][0]["name"] == name
    assert report["refused"][0]["reason"]
    assert desk.snapshot(pid).images == before


def test_a_name_never_becomes_a_path(client: TestClient, desk: Desk, pid: str) -> None:
    report = upload(client, pid, "../../../evil.png", png("pink"))
    assert report["added"][0]["name"].endswith("evil.png")  # shown as it came
    assert not list(desk.root.parent.rglob("evil*"))


def test_a_too_large_upload_is_refused_while_it_comes(
    client: TestClient, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(routes, "MAX_UPLOAD", 1000)
    sent = []

    def chunks() -> Any:
        for number in range(1000):
            sent.append(number)
            yield b"x" * 400

    reply = client.post(f"/projects/{pid}/upload", params={"name": "a.png"}, content=chunks())
    assert reply.status_code == 413
    assert "larger than" in reply.json()["error"]


def test_labels_and_sides_are_kept(client: TestClient, desk: Desk, pid: str, image_id: str) -> None:
    content = {"labels": {image_id: -1}, "splits": {image_id: "unused"}}
    assert marks(client, pid, content) == 200
    image = Desk(desk.root).snapshot(pid).images[image_id]
    assert (image.label, image.split) == (-1, "unused")


@pytest.mark.parametrize(
    "content",
    [
        [],
        "text",
        None,
        {"labels": []},
        {"labels": {UNKNOWN: 1}},
        {"labels": {"../../etc/passwd": 1}},
        {"splits": {UNKNOWN: "train"}},
    ],
)
def test_strange_marks_are_refused(client: TestClient, pid: str, content: object) -> None:
    assert marks(client, pid, content) == 400


@pytest.mark.parametrize("label", [2, 0, "1", True, 1.5, [], {}])
def test_strange_labels_change_nothing(
    client: TestClient, desk: Desk, pid: str, image_id: str, label: object
) -> None:
    before = desk.snapshot(pid).images
    assert marks(client, pid, {"labels": {image_id: label}}) == 400
    assert desk.snapshot(pid).images == before


@pytest.mark.parametrize("split", ["all", 1, [], {}, True])
def test_strange_sides_change_nothing_not_even_the_labels_beside_them(
    client: TestClient, desk: Desk, pid: str, image_id: str, split: object
) -> None:
    before = desk.snapshot(pid).images
    content = {"labels": {image_id: None}, "splits": {image_id: split}}
    assert marks(client, pid, content) == 400
    assert desk.snapshot(pid).images == before


@pytest.mark.parametrize("data", [b"", b"\xff", b"[" * 100_000, b"{"])
def test_broken_json_is_refused(client: TestClient, pid: str, data: bytes) -> None:
    assert client.post(f"/projects/{pid}/marks", content=data).status_code == 400


def test_images_are_removed_with_their_files(
    client: TestClient, desk: Desk, pid: str, image_id: str
) -> None:
    reply = client.post(f"/projects/{pid}/remove", content=json.dumps({"ids": [image_id]}))
    assert reply.status_code == 200
    assert image_id not in desk.snapshot(pid).images
    assert not list((desk.root / pid).rglob(f"*{image_id}*"))
    for ids in (None, "all", [image_id], [1], ["../.."]):
        reply = client.post(f"/projects/{pid}/remove", content=json.dumps({"ids": ids}))
        assert reply.status_code == 400


def test_pictures_come_with_their_type(client: TestClient, pid: str, image_id: str) -> None:
    small = client.get(f"/projects/{pid}/thumbs/{image_id}")
    assert small.headers["content-type"] == "image/webp"
    assert Image.open(io.BytesIO(small.content)).format == "WEBP"
    whole = client.get(f"/projects/{pid}/images/{image_id}")
    assert whole.headers["content-type"] == "image/png"
    assert whole.headers["x-content-type-options"] == "nosniff"
    assert content_hash(whole.content) == image_id


@pytest.mark.parametrize("kind", ["thumbs", "images"])
@pytest.mark.parametrize(
    "image",
    [UNKNOWN, "x", "..%2f..%2fproject.json", "%2e%2e", "A" * 64, "0" * 63 + "%0a", "0" * 65],
)
def test_strange_image_ids_are_not_found(
    client: TestClient, pid: str, kind: str, image: str
) -> None:
    assert client.get(f"/projects/{pid}/{kind}/{image}").status_code == 404


@pytest.mark.parametrize("other", ["..", "%2e%2e", "..%2f..", "nothing", ".", "%00", "a/b"])
def test_strange_project_ids_are_not_found(
    client: TestClient, desk: Desk, pid: str, image_id: str, other: str
) -> None:
    (desk.root.parent / "project.json").write_bytes(
        (desk.root / pid / "project.json").read_bytes()
    )  # a project that lies outside
    reply = client.get(f"/projects/{other}/thumbs/{image_id}")
    assert reply.status_code == 404
    assert client.post(f"/projects/{other}/marks", content=b"{}").status_code in (400, 404, 405)


def test_the_recognizer_is_an_attachment(client: TestClient, desk: Desk, optimized: str) -> None:
    reply = client.get(f"/projects/{optimized}/recognizers/s+.json")
    assert reply.headers["content-disposition"].startswith("attachment; ")
    assert reply.headers["content-type"] == "application/json"
    assert read_recognizer(reply.content, "it").states.positive == "open"
    written = desk.root / optimized / "recognizers" / "s_plus.json"
    assert reply.content == written.read_bytes()


def test_the_name_of_the_attachment_is_harmless(
    client: TestClient, desk: Desk, optimized: str
) -> None:
    with desk.changing(optimized) as project:
        project.name = 'a"; b/../ü'
    kept = client.get(f"/projects/{optimized}/recognizers/s+.json").headers["content-disposition"]
    assert kept == (
        'attachment; filename="s_plus.json"; '
        "filename*=UTF-8''a%22%3B%20b%2F..%2F%C3%BC%20s_plus.json"
    )


@pytest.mark.parametrize("objective", ["s+", "s", "..%2fproject", "S_PLUS"])
def test_a_recognizer_that_is_not_there(client: TestClient, pid: str, objective: str) -> None:
    assert client.get(f"/projects/{pid}/recognizers/{objective}.json").status_code == 404


def test_a_picture_is_recognized(client: TestClient, desk: Desk, optimized: str) -> None:
    project = desk.snapshot(optimized)
    image = next(image for image in project.images.values() if image.label == 1)
    url = f"/projects/{optimized}/recognize/s+"
    verdict = client.post(url, content=project.read(image)).json()
    assert verdict["state_name"] == "open"
    assert sum(verdict["votes"]) == verdict["n_calls"]
    assert client.post(url, content=b"text").status_code == 400
    assert client.post(url, content=b"x" * (routes.MAX_BYTES + 1)).status_code == 413
    assert client.post(url.replace("s+", "s"), content=b"").status_code == 400


def test_a_project_that_another_program_changed_is_read_anew(
    client: TestClient, desk: Desk, pid: str, image_id: str, tmp_path: Path
) -> None:
    with Desk(desk.root).changing(pid) as project:
        project.set_labels([image_id], None)
    assert marks(client, pid, {"splits": {image_id: "test"}}) == 200
    image = desk.snapshot(pid).images[image_id]
    assert (image.label, image.split) == (None, "test")
