"""What the choice of a model says: what a model is, what was found of it, how a job goes."""

from typing import Any
from urllib.parse import urlsplit

from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.availability import Standing
from vqa_state.models.hub.snapshots import DownloadProgress
from vqa_state.models.presets import PRESETS, Preset
from vqa_state.models.vision_check import Sight
from vqa_state.study.vision_check import CheckProgress, ModelCheck
from vqa_state.web import job_watcher
from vqa_state.web.jobs import JobState, Snapshot
from vqa_state.web.session import Desk
from vqa_state.web.view_data import note

__all__ = ["found_words", "kind_words", "preset_of", "progress_note"]

_STANDS = {
    Standing.READY: "On this disk",
    Standing.ABSENT: "Not on this disk yet",
    Standing.OLD_WEIGHTS: (
        "On this disk, but its weights are of an old kind, which is not read: press Convert to "
        "make a safe copy of them, once"
    ),
}


def preset_of(address: ModelAddress) -> Preset | None:
    """The preset that it is, whatever its revision and settings."""
    plain = f"{address.source}:{address.where}"
    return next((one for one in PRESETS if one.address == plain), None)


def kind_words(address: ModelAddress, stands: Standing) -> str:
    """Where its answers come from, and what it needs."""
    if address.source is Source.SERVER:
        host = urlsplit(address.where).netloc
        return f"Every picture and question is sent to {host}. Allow it only if that is right."
    if address.source is Source.FOLDER:
        words = "It is read from a folder of this machine; nothing leaves it."
        return f"{words} {_STANDS[stands]}." if stands is Standing.OLD_WEIGHTS else words
    preset = preset_of(address)
    if preset is None:
        return f"{_STANDS[stands]}; see its page on the hub for its size and licence."
    parts = [
        _STANDS[stands],
        f"about {preset.megabytes() / 1000:.1f} GB of memory in float32",
        f"licence {preset.licence}",
    ]
    return "; ".join([*parts, *(one for one in (preset.requirements, preset.remark) if one)]) + "."


def found_words(desk: Desk, name: str) -> str:
    """What a look at it has found; "" if there was none."""
    found = desk.check(name)
    if found is None:
        return ""
    lines = [found.sentence, *found.notes]
    if found.memory is not None:
        lines.append(f"A process with it takes {found.memory}.")
    if found.pace is not None:
        lines.append(
            f"An image takes {found.pace.image:.2f} s here, and each question about it "
            f"{found.pace.question:.3f} s."
        )
    return "\n".join(lines)


def progress_note(snapshot: Snapshot | None) -> Any:
    """How bringing, converting or looking at a model goes."""
    early = job_watcher.before_reports(snapshot, "Beginning…")
    if snapshot is None or early is not None:
        return early
    report: CheckProgress | DownloadProgress | str = snapshot.report
    if snapshot.state is JobState.STOPPED:
        return note("Stopped. What came is kept.", "warn")
    if isinstance(report, str):
        return note(report, "good" if snapshot.state is JobState.DONE else "plain")
    if isinstance(report, DownloadProgress):
        return _downloaded(report, snapshot.state)
    if report.result is not None:
        return _checked(report.result)
    left = job_watcher.left(report.seconds_left)
    return note(
        f"Showing it pictures: {report.n_done} of {report.n_total} calls{left}",
        share=report.n_done / report.n_total,
    )


def _downloaded(report: DownloadProgress, state: JobState) -> Any:
    if state is JobState.DONE:
        return note("It is on this disk now.", "good")
    words = f"{report.n_bytes / 1e6:,.0f} of {report.total / 1e6:,.0f} MB"
    words += job_watcher.left(report.seconds_left)
    return note(words, share=report.n_bytes / report.total if report.total else 0.0)


def _checked(found: ModelCheck) -> Any:
    tones = {Sight.TELLS: "good", Sight.SEES: "warn", Sight.BLIND: "bad", Sight.SILENT: "bad"}
    tone = tones[found.sight]
    return note(found.sentence, "warn" if tone == "good" and found.warns else tone)
