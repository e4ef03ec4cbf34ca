"""The lock of a folder: one thread of one process at a time, and a clear word to who waits."""

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from vqa_state.errors import ProjectError
from vqa_state.project.project import Project
from vqa_state.storage import locks
from vqa_state.storage.atomic_write import drop_half_written, write_atomically
from vqa_state.storage.locks import LOCK_NAME, locked

ROOT = Path(__file__).parent.parent.parent
HOLDER = """
import sys
from pathlib import Path
from vqa_state.storage.locks import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the lock of `tmp_path`."""
    command = [sys.executable, "-c", HOLDER, tmp_path]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env
    ) as process:
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


def test_a_thread_that_holds_it_goes_right_on_and_leaves_no_file(tmp_path):
    with locked(tmp_path), locked(tmp_path, wait=0), locked(tmp_path / "." / ""):
        assert [path.name for path in tmp_path.iterdir()] == [LOCK_NAME]
    assert list(tmp_path.iterdir()) == []


def test_another_thread_waits(tmp_path):
    order = []

    def other():
        with locked(tmp_path):
            order.append("other")

    with locked(tmp_path):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join(0.1)
        order.append("first")
    thread.join()
    assert order == ["first", "other"]


def test_who_holds_it_long_is_named_and_what_to_do(tmp_path, holder):
    told = rf"being changed by process {holder.pid} on this machine.*nothing was changed here: wait"
    with pytest.raises(ProjectError, match=told), locked(tmp_path, wait=0.05):
        pass
    holder.kill()
    holder.wait()
    with locked(tmp_path, wait=5):  # the system freed it
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_thread_of_this_program_is_named_so(tmp_path):
    errors = []

    def other():
        try:
            with locked(tmp_path, wait=0.05):
                pass
        except ProjectError as error:
            errors.append(str(error))

    with locked(tmp_path):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert "being changed by another page or job of this program" in errors[0]


def test_a_program_of_another_machine_is_named_so(tmp_path, holder):
    (tmp_path / LOCK_NAME).write_text("17 robot")
    told = "by process 17 on the machine robot"
    with pytest.raises(ProjectError, match=told), locked(tmp_path, wait=0.01):
        pass


def read_only(*_args, **_kwargs):
    raise OSError(errno.EROFS, os.strerror(errno.EROFS))


def test_a_read_only_project_opens_and_refuses_changes(project, monkeypatch):
    (project.folder / "thumbnails" / ".writing-00").write_bytes(b"")  # there is something to remove
    monkeypatch.setattr(locks.os, "access", lambda *_: False)
    monkeypatch.setattr(locks.FileLock, "acquire", read_only)
    monkeypatch.setattr(Path, "replace", read_only)
    opened = Project.open(project.folder)
    assert opened == project
    opened.save()  # nothing is to be written
    with opened.changing():
        pass
    told = r"cannot write .*Read-only file system"
    with pytest.raises(ProjectError, match=told), opened.changing():
        opened.name = "new"


def test_a_lock_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / LOCK_NAME).mkdir()
    told = rf"cannot write .*{LOCK_NAME} .*nothing was changed"
    with pytest.raises(ProjectError, match=told), locked(tmp_path):
        pass


@pytest.mark.parametrize("name", ["pace.json", "searches/x.json"])
def test_files_of_a_project_are_written_under_its_lock(project, name):
    thread = threading.Thread(target=write_atomically, args=(project.folder / name, b"x"))
    with locked(project.folder):
        thread.start()
        thread.join(0.1)
        assert not (project.folder / name).exists()
    thread.join()
    assert (project.folder / name).read_bytes() == b"x"


def test_what_was_half_written_elsewhere_goes_when_it_is_old(tmp_path):
    old, young, own = (tmp_path / f".writing-{name}" for name in ("0a", "0b", "my notes"))
    for path in (old, young, own):
        path.write_bytes(b"")
    os.utime(old, (0, 0))
    os.utime(own, (0, 0))
    write_atomically(tmp_path / "out.json", b"{}")
    assert sorted(tmp_path.iterdir()) == sorted([young, own, tmp_path / "out.json"])
    drop_half_written(tmp_path)
    assert not young.exists()
    assert own.exists()
