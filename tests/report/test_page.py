"""The page: complete, self-contained, and deaf to what names try to smuggle in."""

import dataclasses
import re
from dataclasses import replace
from html import escape
from html.parser import HTMLParser

import pytest
from pictures import picture
from study.test_assess import Colours
from tuned_project import MODEL, tuned_copy

from vqa_state import __version__
from vqa_state.evaluation.label_ranking import DoubtfulLabel
from vqa_state.project.project import StateNames
from vqa_state.project.split import Split
from vqa_state.report.galleries import MAX_PICTURES, doubtful_labels
from vqa_state.report.page import report_page
from vqa_state.study.assess import assess
from vqa_state.study.leaderboard import standings
from vqa_state.study.optimize import results
from vqa_state.study.suggest import ask_unlabelled, hints

VOID = {"meta", "img", "br", "path", "polyline", "wbr"}


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
def tuned(make_project, tmp_path):
    return tuned_copy(make_project, tmp_path)


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
    found = results(tuned)
    row, hinted = found.evaluation.rows[0], hints(tuned, found, last.assessment)
    expected = len(row.train_missed) + len(row.test_missed) + len(hinted.doubtful)
    assert tags.count("img") == expected


def test_names_are_shown_as_text(tuned):
    evil = "<script>alert(1)</script>"
    tuned.name = evil
    tuned.states = StateNames("<b>open", '"><img src=x onerror=y>')
    page = page_of(tuned, None)
    assert "<script" not in page
    assert "<b>" not in page
    assert "onerror=y>" not in page
    assert "&lt;script&gt;" in page


def test_it_lists_what_to_label_next_and_what_to_doubt(tuned):
    evil = "<img src=x onerror=y>.png"
    ids = [tuned.add(picture(100 + n), f"new {n}{evil}").image.id for n in range(2)]
    tuned.save()
    found = results(tuned)
    *_, last = assess(tuned, features=Colours, n_resamples=3)
    against = {one.id: -0.9 * one.label for one in tuned.labelled(Split.TRAIN)[:3]}
    kept = last.assessment.model_copy(update={"margins": last.assessment.margins | against})
    assert "2 images have neither a label nor answers" in page_of(tuned, kept)
    list(ask_unlabelled(tuned, found, kept, MODEL))
    page = page_of(tuned, kept)
    hinted = hints(tuned, found, kept)
    assert {one.image_id for one in hinted.next} == set(ids)
    assert len(hinted.doubtful) >= 3
    for heading, ones in (("Label next", hinted.next), ("Possibly mislabelled", hinted.doubtful)):
        part = page.split(f"<h2>{heading}</h2>")[1].split("<h2>")[0]
        assert part.count("<img ") == len(ones)
        places = [part.index(escape(tuned.images[one.image_id].name)) for one in ones]
        assert places == sorted(places)
        for one in ones:
            assert escape(one.reason("open", "closed")) in part
    assert evil not in page


def test_empty_lists_say_so(tuned):
    tuned.states = StateNames("open", "closed")
    page = page_of(tuned, None)
    assert "every image in use has its label" in page
    assert "nothing is assessed yet" in page
    *_, last = assess(tuned, features=Colours, n_resamples=3)
    agreeing = {one.id: 0.5 * one.label for one in tuned.labelled(Split.TRAIN)}
    page = page_of(tuned, last.assessment.model_copy(update={"margins": agreeing}))
    assert "None: no vote that was chosen without a training image" in page


def test_a_long_list_is_cut_and_says_by_how_many(tuned):
    *_, last = assess(tuned, features=Colours, n_resamples=3)
    hinted = hints(tuned, results(tuned), last.assessment)
    one = DoubtfulLabel(tuned.labelled(Split.TRAIN)[0].id, 1, -0.9)
    hinted = dataclasses.replace(hinted, doubtful=(one,) * (MAX_PICTURES + 2))
    shown = doubtful_labels(tuned, hinted, assessed=True)
    assert shown.count("<img ") == MAX_PICTURES
    assert "And 2 more." in shown


def test_provenance_names_program_assessment_and_rival(tuned):
    kept = None
    for last in assess(tuned, features=Colours, n_resamples=3):
        kept = last.assessment
    part = page_of(tuned, kept).split("<h2>Provenance</h2>")[1]
    assert f"VQA State {__version__}" in part
    assert "Assessment: of s+, 3 resamples, seed 0, finished" in part
    assert f"fingerprint: {Colours.fingerprint}" in part
    ended = kept.model_copy(update={"finished": False, "rival": None, "no_rival": "it was stopped"})
    part = page_of(tuned, ended).split("<h2>Provenance</h2>")[1]
    assert "3 resamples, seed 0, stopped by the user" in part
    assert "Rival: none, it was stopped" in part
    assert "Assessment: none" in page_of(tuned, None).split("<h2>Provenance</h2>")[1]


def test_it_is_a_look_at_the_test_images_only_where_there_are_some(tuned):
    found = results(tuned)
    tuned.test_looks = 2
    assert "looked at 3 times, this one included" in page_of(tuned, None)
    alone = replace(found, test=None)
    shown = report_page(tuned, alone, None, standings(tuned.chosen, alone, None))
    assert "looked at" not in shown


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
