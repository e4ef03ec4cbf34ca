"""The command app, and commands on an installation that lacks an extra."""

import sys

import pytest

from vqa_state import errors


@pytest.fixture
def served(monkeypatch):
    """What the server was asked for, instead of serving."""
    from vqa_state.web import server

    calls = []
    monkeypatch.setattr(server, "serve", lambda folder, **given: calls.append((folder, given)) or 0)
    return calls


def test_the_app_opens_in_the_users_own_data_folder(run, served, data_home):
    assert run("app")[0] == 0
    assert served == [
        (data_home / "projects", {"host": "127.0.0.1", "port": 7860, "browser": True})
    ]


def test_what_is_typed_is_what_is_served(run, served, tmp_path):
    run("app", "--projects", tmp_path, "--port", 0, "--host", "::1", "--no-browser")
    assert served == [(tmp_path, {"host": "::1", "port": 0, "browser": False})]


@pytest.mark.parametrize("typed", [("--port", "70000"), ("--projects", "")])
def test_a_wrong_option_is_refused(run, served, typed):
    assert run("app", *typed)[0] == 2
    assert not served


def test_a_folder_that_is_a_file_is_told(run, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, said = run("app", "--projects", tmp_path / "file", "--no-browser", "--port", 0)
    assert code == 1
    assert "is a file, or lies in one; name a folder with --projects DIR" in said


def test_without_its_packages_the_app_names_the_extra(run, monkeypatch):
    monkeypatch.setattr(errors, "find_spec", lambda package: None)
    code, _, said = run("app")
    assert code == 1
    assert "the app needs the package 'gradio'" in said
    assert "pip install 'vqa-state[app]'" in said


def test_a_command_that_meets_a_missing_extra_names_it(run, monkeypatch, project):
    monkeypatch.setitem(sys.modules, "transformers", None)
    code, _, said = run("models", "check", "embedded")
    assert code == 0  # it needs none
    from vqa_state.cli import choosing

    def needs_one(*_):
        import transformers

        return transformers

    monkeypatch.setattr(choosing, "plan", needs_one)
    code, _, said = run("models", "check", "embedded", "--project", project.folder)
    assert code == 1
    assert "error: this command needs the package 'transformers'" in said
    assert "pip install 'vqa-state[local]'" in said


def test_samples_are_not_in_an_installed_package(run, monkeypatch, tmp_path):
    from vqa_state.cli import reproducing

    missing = tmp_path / "site-packages" / "projects"
    monkeypatch.setattr(reproducing, "_SAMPLES", missing)
    code, _, said = run("reproduce", "--out", tmp_path / "out", "--projects", missing)
    assert code == 1
    assert "not part of an installed package; clone the repository" in said
