"""models …: which there are, saying yes to one, bringing it here, looking whether it sees."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vqa_state import models
from vqa_state.asking import plan
from vqa_state.checking import check_model
from vqa_state.cli.options import Json, app, tell
from vqa_state.cli.terminal import interruptible, say, show_check, show_download
from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.approval import approve, approved, withdraw
from vqa_state.models.hub import download, is_cached
from vqa_state.models.presets import PRESETS, Preset
from vqa_state.project import Project

__all__ = ["models_app"]

models_app = typer.Typer(
    help="Models: list, approve, download, check, convert.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.add_typer(models_app, name="models")

Address = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="hub:OWNER/NAME, folder:/path/to/model, server:http://host:port/v1#MODEL",
    ),
]


@models_app.command("list")
def list_command(as_json: Json = False) -> None:
    """The models to begin with, whether they are on this disk, and those that you approved."""
    own = [*models.names(), *approved()]
    here = {one.address: is_cached(ModelAddress.parse(one.address)) for one in PRESETS}
    lines = [f"{name:45} usable now" for name in own]
    lines += [f"{one.address:45} {_words(one, here[one.address])}" for one in PRESETS]
    rows = [
        asdict(one) | {"megabytes_float32": one.megabytes(), "on_this_disk": here[one.address]}
        for one in PRESETS
    ]
    tell(as_json, {"usable": own, "presets": rows}, "\n".join(lines))


def _words(preset: Preset, is_here: bool) -> str:
    where = "on this disk" if is_here else "not on this disk"
    words = [where, f"{preset.megabytes():,} MB in float32", preset.licence]
    words += [f"needs {', '.join(preset.needs)}"] if preset.needs else []
    words += [preset.remark] if preset.remark else []
    return "; ".join(words)


@models_app.command("approve")
def approve_command(
    model: Address,
    forget: Annotated[bool, typer.Option("--forget", help="Take the yes back.")] = False,
) -> None:
    """Say yes to a model that a project or recognizer of somebody else names."""
    address = ModelAddress.parse(model)
    if forget:
        withdraw(address)
        say(f"{address} is not used any more until you say so")
        return
    approve(address)
    where = "; your pictures will be sent to it" if address.source is Source.SERVER else ""
    say(f"{address} may be used on this machine{where}")


@models_app.command("download")
def download_command(model: Address) -> None:
    """Bring a model of the hub to this disk; stopped or killed, it goes on where it was."""
    address = ModelAddress.parse(model)
    if address.source is not Source.HUB:
        raise typer.BadParameter("only a model of the hub can be downloaded: hub:OWNER/NAME")
    with interruptible() as stop:
        last = show_download(download(address, stop))
    if last.stopped:
        say("stopped by you; what came is kept")
        raise typer.Exit(3)
    approve(address)
    say(f"{address} is on this disk")


@models_app.command("check")
def check_command(
    model: Address,
    project: Annotated[
        Path | None, typer.Option(help="Say what asking about this project would take.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the model some pictures: does it see, how fast is it, what memory does it take?"""
    vqa_model = models.create(models.choose(model))
    with interruptible() as stop:
        found = show_check(check_model(vqa_model, stop))
    if found is None:
        raise typer.Exit(3)
    lines = [found.name, found.sentence, *found.notes, f"{found.megabytes:,} MB of memory"]
    record: dict[str, object] = {
        "model": found.name,
        "fingerprint": found.fingerprint,
        "sight": found.sight.value,
        "notes": list(found.notes),
        "megabytes": found.megabytes,
    }
    if found.pace is not None:
        record |= {"seconds_image": found.pace.image, "seconds_question": found.pace.question}
        lines.append(
            f"{found.pace.image:.2f} s an image and {found.pace.question:.3f} s a question"
        )
        if project is not None:
            costs = plan(Project.open(project), found.fingerprint)
            record |= {"n_to_ask": costs.n_to_ask, "seconds": found.pace.seconds(costs)}
            lines.append(
                f"{costs.n_to_ask:,} calls to ask ({costs.n_stored:,} in the store): about "
                f"{found.pace.seconds(costs) / 60:.1f} minutes"
            )
    tell(as_json, record, "\n".join(lines))
    if found.pace is None:
        raise typer.Exit(1)


@models_app.command("convert")
def convert_command(
    folder: Annotated[Path, typer.Argument(help="Holds config.json and pytorch_model.bin.")],
) -> None:
    """Write the weights of an old checkpoint as safetensors, once. No code in it is run."""
    from vqa_state.models.ofa.loading import convert_checkpoint

    if not (folder / "pytorch_model.bin").is_file():
        raise ModelError(f"{folder} holds no pytorch_model.bin; there is nothing to convert")
    say(f"written: {convert_checkpoint(folder)}")
