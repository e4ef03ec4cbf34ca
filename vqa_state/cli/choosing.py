"""models …: which there are, saying yes to one, bringing it here, looking whether it sees."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vqa_state import models
from vqa_state.cli.options import Json, app, tell
from vqa_state.cli.terminal import interruptible, say, show_check, show_download
from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.approval import approve, approved, withdraw
from vqa_state.models.availability import Standing, standing
from vqa_state.models.hub.snapshots import download
from vqa_state.models.opening import folder_of
from vqa_state.models.presets import PRESETS, Preset
from vqa_state.models.server.served_models import offered
from vqa_state.project.project import Project
from vqa_state.study.collect import plan
from vqa_state.study.vision_check import check_model

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
def list_command(
    server: Annotated[
        str | None,
        typer.Option(metavar="URL", help="List what this server offers: http://host:port/v1"),
    ] = None,
    as_json: Json = False,
) -> None:
    """The models to begin with, whether they are on this disk, and those that you approved."""
    if server is not None:
        _list_server(server, as_json)
        return
    own = {address: _standing(address) for address in approved()}
    stands = {one.address: _standing(one.address) for one in PRESETS}
    lines = [f"{name:45} usable now" for name in models.names()]
    lines += [f"{address:45} {_approved_words(address, own[address])}" for address in own]
    lines += [f"{one.address:45} {_words(one, stands[one.address])}" for one in PRESETS]
    rows = [
        asdict(one)
        | {
            "megabytes_float32": one.megabytes(),
            "on_this_disk": stands[one.address] is not Standing.ABSENT,
            "must_be_converted": stands[one.address] is Standing.OLD_WEIGHTS,
            "wants_gpu": one.wants_gpu,
            "missing": one.missing,
        }
        for one in PRESETS
    ]
    record = {
        "usable": [*models.names(), *(one for one in own if own[one] is Standing.READY)],
        "approved": [{"address": one, "standing": own[one].value} for one in own],
        "presets": rows,
    }
    tell(as_json, record, "\n".join(lines))


def _standing(address: str) -> Standing:
    """How far a model is; what is no address (a changed list of approved ones) is nowhere."""
    try:
        return standing(ModelAddress.parse(address))
    except ModelError:
        return Standing.ABSENT


def _approved_words(address: str, stands: Standing) -> str:
    if stands is Standing.READY and address.startswith(f"{Source.SERVER.value}:"):
        return "approved, on a server; `models list --server URL` asks if it is there"
    if stands is Standing.READY:
        return "approved, usable now"
    return f"approved, {_where(stands, address)}"


def _where(stands: Standing, address: str) -> str:
    return {
        Standing.READY: "on this disk",
        Standing.ABSENT: "not on this disk",
        Standing.OLD_WEIGHTS: "on this disk, to be converted once with: "
        f"python -m vqa_state models convert {address}",
    }[stands]


def _list_server(url: str, as_json: bool) -> None:
    """Typing the URL is the user's yes to this one call."""
    addresses = offered(url)
    words = "\n".join(addresses) or f"{url} offers no model"
    tell(as_json, {"server": url, "models": addresses}, words)


def _words(preset: Preset, stands: Standing) -> str:
    words = [
        _where(stands, preset.address),
        f"{preset.megabytes():,} MB in float32",
        preset.licence,
    ]
    words += [one for one in (preset.requirements, preset.remark) if one]
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
    if standing(address) is Standing.OLD_WEIGHTS:
        say(f"its weights must be converted once: python -m vqa_state models convert {address}")


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
    lines = [found.name, found.sentence, *found.notes, str(found.memory)]
    record: dict[str, object] = {
        "model": found.name,
        "fingerprint": found.fingerprint,
        "sight": found.sight.value,
        "notes": list(found.notes),
        "n_calls": found.n_calls,
        "n_failed": found.n_failed,
        "failure": found.failure,
    }
    if found.memory is not None:
        record |= {"megabytes": found.memory.process, "gpu_megabytes": found.memory.gpu}
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
    model: Annotated[
        str,
        typer.Argument(
            metavar="FOLDER", help="Holds config.json and pytorch_model.bin; or hub:OWNER/NAME."
        ),
    ],
) -> None:
    """Write the weights of an old checkpoint as safetensors, once. No code in it is run."""
    from vqa_state.models.local.ofa.loading import convert_checkpoint

    is_address = model.startswith(("hub:", "folder:"))
    folder = folder_of(ModelAddress.parse(model)) if is_address else Path(model)
    if not (folder / "pytorch_model.bin").is_file():
        raise ModelError(f"{folder} holds no pytorch_model.bin; there is nothing to convert")
    say(f"written: {convert_checkpoint(folder)}")
