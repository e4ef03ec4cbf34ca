"""new, add, label, grid: what a project is made of."""

from pathlib import Path
from typing import Annotated

import typer

from vqa_state import models
from vqa_state.cli.added import report_record, unlabelled_lines
from vqa_state.cli.options import Folder, Json, app, found_results, tell
from vqa_state.cli.picking import chosen_images, given_path
from vqa_state.cli.terminal import interruptible, say, show_asking
from vqa_state.errors import ImageError
from vqa_state.project.importing import ImportReport, Refused, add_folder, in_turn, still_unlabelled
from vqa_state.project.project import LabelledImage, Project, StateNames
from vqa_state.project.split import Split
from vqa_state.questions.cues import with_cues
from vqa_state.questions.grid import (
    Article,
    Form,
    Question,
    QuestionGrid,
    StatePhrase,
    Wording,
    phrases_for,
)
from vqa_state.report.frames import look_alike_sentences
from vqa_state.study.assess import assessment
from vqa_state.study.suggest import accept, ask_unlabelled, hints


@app.command()
def new(
    folder: Folder,
    name: Annotated[str, typer.Option(help="What the thing is called, for example refrigerator.")],
    positive: Annotated[str, typer.Option(help="Name of the one state.")] = "open",
    negative: Annotated[str, typer.Option(help="Name of the other state.")] = "closed",
    seed: Annotated[
        int, typer.Option(min=0, max=2**32 - 1, help="Of the copies and of the split.")
    ] = 0,
    as_json: Json = False,
) -> None:
    """Make a project. Its questions begin with NAME as the wording and the states as phrases."""
    first_grid = QuestionGrid((Wording(name),), phrases_for(positive, negative))
    states = StateNames(positive, negative)
    project = Project.create(folder, name, states, grid=first_grid, seed=seed)
    tell(as_json, _summary(project), f"made {folder}: {_sentence(project)}")


@app.command()
def add(
    folder: Folder,
    paths: Annotated[
        list[Path], typer.Argument(parser=given_path, help="Pictures, folders or ZIP files.")
    ],
    state: Annotated[str | None, typer.Option(help="State of all these pictures.")] = None,
    as_json: Json = False,
) -> None:
    """Add pictures. Folders named as the states label them; train/ and test/ give the side.

    A file that cannot be read is named with its reason and skipped. What got no label is told, too:
    how many, and which folder names no state. Pictures are saved a few at a time, so others can
    work on the project meanwhile, and a stop keeps what was added.
    """
    project = Project.open(folder)
    label = None if state is None else project.states.named(state)
    done = [_add(project, path, label) for path in paths]
    whole = ImportReport(
        tuple(i for one in done for i in one.added),
        tuple(i for one in done for i in one.already_there),
        tuple(r for one in done for r in one.refused),
        still_unlabelled(project, (u for one in done for u in one.unlabelled)),
    )
    with project.changing():
        project.assign_splits()
    tell(as_json, report_record(whole), f"{whole.sentence()}. {_sentence(project)}")
    for one in whole.refused:
        say(f"refused: {one.name}: {one.reason}")
    for line in unlabelled_lines(project.states, whole):
        say(line)
    for sentence in look_alike_sentences(project):
        say(sentence)
    if not whole.added and not whole.already_there:
        raise typer.Exit(1)


@app.command()
def label(
    folder: Folder,
    images: Annotated[
        list[str] | None,
        typer.Argument(help="Names, or 4 or more first letters of ids; none: just list."),
    ] = None,
    state: Annotated[str | None, typer.Option(help="One of the states, or 'none'.")] = None,
    split: Annotated[Split | None, typer.Option(help="Put them on this side.")] = None,
    divide: Annotated[
        float | None, typer.Option(min=0.05, max=0.95, help="Divide afresh; share for training.")
    ] = None,
    suggest: Annotated[
        bool,
        typer.Option("--suggest", help="Ask the model about images without a label; list labels."),
    ] = False,
    accept_labels: Annotated[
        bool,
        typer.Option("--accept", help="With --suggest: give these IMAGEs (or all) their labels."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Label images, put them on a side, or list them. Look-alikes always go to one side.

    --suggest alone changes no label. An accepted image becomes a training image: a label that came
    from a vote must not judge it.
    """
    project = Project.open(folder)
    if accept_labels and not suggest:
        raise typer.BadParameter("--accept goes with --suggest")
    if suggest:
        _suggest(
            project, set(chosen_images(project, images or [])), as_json, accepted=accept_labels
        )
        return
    with project.changing():
        chosen = chosen_images(project, images or [])
        if not chosen and (state is not None or split is not None):
            raise typer.BadParameter("--state and --split need the names or ids of images")
        if state is not None:
            project.set_labels(chosen, None if state == "none" else project.states.named(state))
        if split is not None:
            project.set_splits(chosen, split)
        project.assign_splits(train_share=divide or 0.5, afresh=divide is not None)
    shown = [_record(project, image) for image in project.images.values()]
    lines = [
        f"{i['id']:.12}  {i['state'] or '–':10} {i['split'] or '–':6} {i['name']}" for i in shown
    ]
    lines += look_alike_sentences(project)
    tell(as_json, shown, "\n".join(lines))


@app.command()
def grid(
    folder: Folder,
    wording: Annotated[
        list[str] | None,
        typer.Option(help="A name for the thing; 'water | in {article} sink' has a tail."),
    ] = None,
    phrase: Annotated[
        list[str] | None, typer.Option(help="A phrase of the positive state (replaces all).")
    ] = None,
    antonym: Annotated[
        list[str] | None, typer.Option(help="A phrase of the negative state; default: not PHRASE.")
    ] = None,
    form: Annotated[list[Form] | None, typer.Option(help="is, does or both.")] = None,
    article: Annotated[list[Article] | None, typer.Option(help="a, the, this, that.")] = None,
    yes_positive: Annotated[
        list[str] | None, typer.Option(help="A question of your own; yes = positive state.")
    ] = None,
    yes_negative: Annotated[
        list[str] | None, typer.Option(help="A question of your own; yes = negative state.")
    ] = None,
    cues: Annotated[
        bool,
        typer.Option("--cues", help="Add ready questions about what one can see."),
    ] = False,
    off: Annotated[list[str] | None, typer.Option(help="Switch this question off.")] = None,
    on: Annotated[list[str] | None, typer.Option(help="Switch this question on again.")] = None,
    as_json: Json = False,
) -> None:
    """Show the questions, or change their axes: form × wording × phrase × article."""
    own = [Question(text, 1) for text in yes_positive or []]
    own += [Question(text, -1) for text in yes_negative or []]
    with Project.open(folder).changing() as project:
        old = project.grid
        project.grid = QuestionGrid(
            wordings=tuple(map(Wording.parse, wording)) if wording else old.wordings,
            phrases=_phrases(old, phrase, antonym),
            forms=tuple(form) if form else old.forms,
            articles=tuple(article) if article else old.articles,
            custom=(*old.custom, *(one for one in own if one not in old.custom)),
            switched_off=tuple((set(old.switched_off) | set(off or [])) - set(on or [])),
        )
        if cues:
            project.grid = with_cues(project.grid, project.states.positive)
        built = project.grid.build()
        known = {q.text for q in (*built.questions, *built.switched_off)}
        strange = [text for text in (*(off or []), *(on or [])) if text not in known]
        if strange:
            raise typer.BadParameter(f"there is no question {strange[0]!r}; copy it from the grid")
    record = {
        "questions": [{"text": q.text, "yes_means": q.yes_means} for q in built.questions],
        "switched_off": [q.text for q in built.switched_off],
        "duplicates": [q.text for q in built.duplicates],
    }
    lines = [f"{'+' if q.yes_means > 0 else '-'} {q.text}" for q in built.questions]
    lines += [f"off  {q.text}" for q in built.switched_off]
    lines += [f"dropped, stands there already: {q.text}" for q in built.duplicates]
    lines.append(f"{len(built.questions)} questions")
    tell(as_json, record, "\n".join(lines))


def _suggest(project: Project, only: set[str], as_json: bool, *, accepted: bool) -> None:
    """Suggest labels, and keep those that were accepted."""
    found = found_results(project)
    assessed = assessment(project, found)
    if hints(project, found, assessed).n_unasked:
        model = models.create(project.model)
        with interruptible() as stop:
            show_asking(ask_unlabelled(project, found, assessed, model, stop))
        if stop():
            say("stopped by you; what was answered is kept, and no label was changed")
            raise typer.Exit(3)
    suggested = hints(project, found, assessed).suggestions
    shown = tuple(one for one in suggested if not only or one.image_id in only)
    if accepted:
        with project.changing():  # asking took its time: others may have labelled meanwhile
            shown = accept(project, shown)
    rows = [
        {
            "id": one.image_id,
            "name": project.images[one.image_id].name,
            "state": project.states.of(one.label),
            "sureness": one.sureness,
            "accepted": accepted,
        }
        for one in shown
    ]
    done = "accepted" if accepted else "suggested"
    lines = [
        f"{r['id']!s:.12}  {done}: {r['state']} ({one.sureness:.2f} sure)  {r['name']}"
        for r, one in zip(rows, shown, strict=True)
    ]
    tell(as_json, rows, "\n".join(lines) or "no suggestion: every image has a label, or a tie")


def _phrases(
    old: QuestionGrid, phrases: list[str] | None, antonyms: list[str] | None
) -> tuple[StatePhrase, ...]:
    """The old phrases, with those of a state replaced that were given."""
    positive = [StatePhrase(text, 1) for text in phrases or []]
    if phrases and not antonyms:
        antonyms = [f"not {text}" for text in phrases]
    negative = [StatePhrase(text, -1) for text in antonyms or []]
    return (
        *(positive or (one for one in old.phrases if one.yes_means > 0)),
        *(negative or (one for one in old.phrases if one.yes_means < 0)),
    )


def _add(project: Project, path: Path, label: int | None) -> ImportReport:
    """What `add_folder` says; a path that leads nowhere is refused like a file."""
    try:
        return add_folder(project, path, label, opened=lambda: in_turn(project))
    except ImageError as error:
        return ImportReport((), (), (Refused(str(path), str(error)),))


def _record(project: Project, image: LabelledImage) -> dict[str, str | None]:
    return {
        "id": image.id,
        "name": image.name,
        "state": project.states.of(image.label) if image.label else None,
        "split": image.split.value if image.split else None,
    }


def _summary(project: Project) -> dict[str, object]:
    return {
        "folder": str(project.folder),
        "n_images": len(project.images),
        "n_train": len(project.labelled(Split.TRAIN)),
        "n_test": len(project.labelled(Split.TEST)),
        "n_questions": len(project.grid.build().questions),
    }


def _sentence(project: Project) -> str:
    now = _summary(project)
    return (
        f"{now['n_images']} images ({now['n_train']} train, {now['n_test']} test), "
        f"{now['n_questions']} questions"
    )
