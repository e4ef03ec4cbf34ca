"""The page: complete, self-contained, and deaf to what names try to smuggle in."""

import re
from html.parser import HTMLParser

import pytest
from test_assessing import MODEL, Colours

from vqa_state.asking import ask
from vqa_state.assessing import assess
from vqa_state.project import StateNames
from vqa_state.report_page import report_page
from vqa_state.search.genetic import SearchSettings
from vqa_state.standings import standings
from vqa_state.tuning import optimize, results

VOID = {"meta", "img", "br", "path", "polyline"}


class Balanced(HTMLParser):
    """Every tag is closed, and nothing is fetched or run."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture
def tuned(make_project):
    project = make_project(n_train=4, n_test=3)
    project.search = SearchSettings(population=30, generations=5)
    project.model, project.fingerprint = MODEL.name, MODEL.fingerprint
    list(ask(project, MODEL))
    list(optimize(project, prove=False))
    return project


def page_of(project, assessed):
    found = results(project)
    return report_page(project, found, assessed, standings(project.chosen, found, assessed))


def test_it_is_whole_and_fetches_nothing(tuned):
    *_, last = assess(tuned, features=Colours, n_resamples=4)
    page = page_of(tuned, last.assessment)
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    tags = [tag for tag, _ in parser.seen]
    assert tags.count("svg") == 2
    assert not {"script", "link", "iframe", "form", "object"} & set(tags)
    for _, attributes in parser.seen:
        assert not any(name.startswith("on") or name == "href" for name in attributes)
        assert attributes.get("src", "data:image/webp").startswith("data:image/webp")
    assert "http" not in re.sub(r"data:[^\"]*", "", page)
    for question in tuned.questions():
        assert question.text in page
    row = results(tuned).evaluation.rows[0]
    assert tags.count("img") == len(row.train_missed) + len(row.test_missed)


def test_names_are_shown_as_text(tuned):
    evil = "<script>alert(1)</script>"
    tuned.name = evil
    tuned.states = StateNames("<b>open", '"><img src=x onerror=y>')
    page = page_of(tuned, None)
    assert "<script" not in page
    assert "<b>" not in page
    assert "onerror=y>" not in page
    assert "&lt;script&gt;" in page


def test_without_an_assessment_it_says_so(tuned):
    page = page_of(tuned, None)
    assert "Not assessed yet" in page
    assert "<svg" not in page


def test_a_picture_that_is_gone_ends_nothing(tuned):
    for image in tuned.images.values():
        tuned.image_path(image).unlink()
        for thumb in (tuned.folder / "thumbnails").glob(f"{image.id}*"):
            thumb.unlink()
    assert "<img" not in page_of(tuned, None)
