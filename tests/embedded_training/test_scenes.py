"""Rendered scenes: the same address gives the same picture, and no two splits share one."""

import numpy as np
import pytest
from PIL import Image

from vqa_state.embedded_training.dataset import load_examples, render_split
from vqa_state.embedded_training.photos import is_training_photo, load_photos
from vqa_state.embedded_training.scenes import (
    THINGS,
    RenderedPicture,
    SceneRenderer,
    SceneSplit,
)
from vqa_state.embedded_training.scenes.random_draws import scene_generator
from vqa_state.errors import ProjectError


@pytest.fixture(scope="module")
def renderer():
    # Two software drawing contexts in one process draw garbage: one for the whole module.
    with SceneRenderer(64) as open_renderer:
        yield open_renderer


@pytest.mark.parametrize("thing", THINGS)
def test_same_address_same_pictures(renderer, thing):
    first = renderer.render(thing, SceneSplit.TRAIN, 7)
    again = renderer.render(thing, SceneSplit.TRAIN, 7)
    assert [picture.is_positive for picture in first] == [True, False]
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(np.asarray(one.image), np.asarray(other.image))
        assert one.facts == other.facts


@pytest.mark.parametrize("thing", THINGS)
def test_states_look_different(renderer, thing):
    positive, negative = renderer.render(thing, SceneSplit.TRAIN, 8)
    difference = np.asarray(positive.image, float) - np.asarray(negative.image, float)
    assert np.abs(difference).mean() > 1
    assert positive.facts != negative.facts


def test_splits_share_no_randomness():
    draws = {
        (thing, split, seed): scene_generator(thing, split, seed).integers(2**62)
        for thing in THINGS
        for split in SceneSplit
        for seed in range(200)
    }
    assert len(set(draws.values())) == len(draws)


def test_splits_share_no_picture(renderer):
    pictures = [renderer.render("door", split, 0)[0].image.tobytes() for split in SceneSplit]
    assert len(set(pictures)) == len(SceneSplit)


def test_views_come_in_pairs(renderer):
    labels = [p.is_positive for p in renderer.render("water", SceneSplit.TRAIN, 3, n_views=2)]
    assert labels == [True, False, True, False]


def test_unusable_sizes_are_refused():
    with pytest.raises(ValueError, match="from 16 to 320"):
        SceneRenderer(321)


class TestPhotos:
    @pytest.fixture
    def folder(self, tmp_path):
        for state in ("open", "closed"):
            (tmp_path / "door_open" / state).mkdir(parents=True)
            for number in range(20):
                (tmp_path / "door_open" / state / f"{state}{number}.jpg").touch()
        return tmp_path

    def test_halves_are_disjoint_and_complete(self, folder):
        halves = [load_photos(folder, training=flag) for flag in (True, False)]
        paths = [example.path for half in halves for example in half]
        assert len(set(paths)) == len(paths) == 40
        assert all(is_training_photo(example.path) for example in halves[0])

    def test_a_photo_cut_twice_stays_on_one_side(self, tmp_path):
        first, second = tmp_path / "a" / "id.jpg", tmp_path / "b" / "id.jpg"
        assert is_training_photo(first) == is_training_photo(second)

    def test_a_folder_without_photos_is_an_error(self, tmp_path):
        with pytest.raises(ProjectError, match="refrigerator_open"):
            load_photos(tmp_path, training=True)


def test_a_stopped_rendering_goes_on(tmp_path, monkeypatch):
    rendered = []

    class FakeRenderer:
        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def render(self, thing, split, seed, n_views):
            rendered.append(seed)
            image = Image.new("RGB", (8, 8))
            return [RenderedPicture(image, thing, positive, {}) for positive in (True, False)]

    monkeypatch.setattr("vqa_state.embedded_training.dataset.SceneRenderer", FakeRenderer)
    for n_scenes in (3, 5):
        render_split(tmp_path, SceneSplit.TRAIN, n_scenes, 1, 1, ["door"])
    assert rendered == [0, 1, 2, 3, 4]
    assert len(load_examples(tmp_path)) == 10
