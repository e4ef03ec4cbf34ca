"""Starting the app, and how its page shows errors."""

from pathlib import Path

import pytest

from vqa_state.errors import ProjectError
from vqa_state.web.page import message
from vqa_state.web.server import main


@pytest.mark.parametrize("port", ["99999", "-1", "x", "", "1.5"])
def test_a_port_that_is_none_is_said(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([f"--port={port}"])
    assert "0 to 65535" in capsys.readouterr().err


def test_a_file_in_the_place_of_the_projects_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    for path in (file, file / "below"):
        assert main(["--projects", str(path), "--port", "0"]) == 1
        assert "is a file, or lies in one; name a folder" in capsys.readouterr().err


def test_an_error_on_the_page_is_text_and_no_html() -> None:
    shown = message(ProjectError("got '<h1>big</h1> & <a href=x>more</a>'"))
    assert "<" not in shown.message
    assert shown.message.startswith("got '&lt;h1&gt;big")
