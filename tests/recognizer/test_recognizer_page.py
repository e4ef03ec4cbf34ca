"""docs/recognizer.md is enough: a reader written from it alone says what the program says."""

import hashlib
import json
import re
import unicodedata
from fractions import Fraction
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_recognizers import recognizer
from PIL import Image

from vqa_state.answers import parse, thinking
from vqa_state.answers.answer import Answer, read_answer
from vqa_state.images import pixel_hash
from vqa_state.images.augmentation import AugmentationKind
from vqa_state.recognizer.inference import shifted
from vqa_state.recognizer.recognizer import Copies, Recognizer, WeightedQuestion
from vqa_state.recognizer.schema import Abstain
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind

DOCS = Path(__file__).parent.parent.parent / "docs"
PAGE = (DOCS / "recognizer.md").read_text(encoding="utf-8")
EXAMPLE = DOCS / "recognizer.example.json"


# ---- the reader: nothing of the program is used ----------------------------------------------


def rules():
    """The words and expressions that the page gives."""
    (block,) = re.findall(r"```\n(yes .*?)```", PAGE, re.DOTALL)
    lines = re.sub(r"\n +", "", block).splitlines()
    return dict(re.split(r" {2,}", line, maxsplit=1) for line in lines)


RULES = rules()
VALUE = dict.fromkeys(RULES["yes"].split(), 1) | dict.fromkeys(RULES["no"].split(), -1)


def read(text):
    """+1 yes, -1 no, 0 invalid: section 2."""
    text = unicodedata.normalize("NFKC", text).replace("’", "'").replace("‐", "-").lower()
    text = re.sub(RULES["box"], "\nanswer: ", spoken(text))
    text = re.sub(RULES["role"], "", re.sub(RULES["tag"], " ", text).strip())
    if re.search(RULES["hedge"], text) or re.search(RULES["foreign"], text):
        return 0
    parts = [part for part in re.split(RULES["lead"], text) if re.search(RULES["word"], part)]
    said = [read_part(part) for part in parts]
    return 0 if not said or {1, -1} <= set(said) else said[-1]


def spoken(text):
    """What was not thought."""
    marks = [
        (mark.start(), mark.end(), rule, mark[1])
        for rule in ("opens", "closes")
        for mark in re.finditer(RULES[rule], text)
    ]
    kept, is_open, place = "", set(), 0
    for start, end, rule, name in sorted(marks, key=lambda mark: mark[0]):
        kept += text[place:start] if not is_open else ""
        place = end
        if rule == "opens":
            is_open |= {name}
        elif is_open:
            is_open -= {name}
        else:
            kept = ""
    return kept + (text[place:] if not is_open else "")


def read_part(text):
    words = list(re.finditer(RULES["word"], text))
    said = [VALUE.get(word[0], 0) for word in words]
    behind = text[words[0].end() :]
    follows = re.match(RULES["next"], behind)
    if words[0][0] in RULES["of a noun"].split() and follows:
        word = follows[1] or ""
        if not re.fullmatch(RULES["beginner"], word) and word not in VALUE:
            return 0
    if not said[0] or re.search(RULES["taken back"], behind):
        return 0
    if -said[0] not in said:
        return said[0]
    others = "|".join(word for word, value in VALUE.items() if value == -said[0])
    turns = re.search(RULES["turn"].replace("OTHER", others), behind)
    return said[0] if 0 in said and re.match(RULES["set off"], behind) and not turns else 0


def counted(file, votes):
    """10^6 (S - t T), 10^6 S and T of some votes (w, v, p), in whole numbers: section 3."""
    if file["vote"] in ("paper", "threshold"):
        votes = [vote for vote in votes if vote[1]]
    by_share = file["vote"] == "weighted p_yes"
    S = 10**6 * sum(w * (p if by_share else Fraction(1 + v, 2)) for w, v, p in votes)
    T = sum(w for w, _, _ in votes)
    return int(S) - round(10**6 * file["threshold"]) * T, int(S), T


def judged(file, copies):
    """Verdict, leaning, share, lead, agreement and sureness: sections 3 to 5."""
    votes = [vote for copy in copies for vote in copy]
    excess, S, T = counted(file, votes)
    by_share = file["vote"] == "weighted p_yes"
    if T == 0 or not (by_share or any(v for _, v, _ in votes)):
        return "unknown", 0, None, 0.0, 0.0, 0.0
    leaning, W = sign(excess), sum(w for w, _, _ in votes)
    pulls = [leaning * w * (2 * p - 1 if by_share else v) for w, v, p in votes]
    most = int(10**6 * sum(pull for pull in pulls if pull > 0)) / (10**6 * W)
    at = round(10**6 * file["threshold"])
    lead = min(abs(excess) / ((10**6 - at if leaning > 0 else at) * W), most)
    agreement = sum(sign(counted(file, copy)[0]) == leaning for copy in copies) / len(copies)
    sureness = lead * agreement if leaning else 0.0
    sure = leaning and sureness >= file["abstain"]["min_sureness"]
    name = file["states"]["positive" if leaning > 0 else "negative"] if sure else "unknown"
    return name, leaning, Fraction(S, 10**6 * T), lead, agreement, sureness


def settled(file, copies):
    """The verdict, and after how many copies it is certain: section 6."""
    for n in range(1, len(copies)):
        ends = {judged(file, copies[:n] + filled(copies[n:], v))[0] for v in (1, -1)}
        valid = file["vote"] == "weighted p_yes" or any(v for c in copies[:n] for _, v, _ in c)
        if len(ends) == 1 and valid:
            return ends.pop(), n
    return judged(file, copies)[0], len(copies)


def filled(copies, v):
    return [[(w, v, Fraction(1 + v, 2)) for w, *_ in copy] for copy in copies]


def votes(file, said):
    """(w, v, p) of the answers (text, p_yes) to each question about each copy: section 2."""
    return [
        [
            (
                q["weight"],
                read(text) * q["yes_means"],
                None if p is None else _share(p) if q["yes_means"] > 0 else 1 - _share(p),
            )
            for q, (text, p) in zip(file["questions"], copy, strict=True)
        ]
        for copy in said
    ]


def _share(p_yes):
    return Fraction(round(p_yes, 6)).limit_denominator(10**6)


def sign(number):
    return (number > 0) - (number < 0)


def changed(pixels, copies):
    """The copies of (height, width, 3) values: section 1."""
    height, width = len(pixels), len(pixels[0])
    values = [value for row in pixels for pixel in row for value in pixel]
    size = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    H = hashlib.sha256(size + bytes(values)).hexdigest()
    made = []
    for n in range(copies["n_copies"]):

        def drawn(k, n=n):
            return hashlib.sha256(f"{copies['seed']}:{H}:{n}:{k}".encode()).digest()

        if copies["kind"] == "rgb-shift":
            shares = [int.from_bytes(drawn(k)[:8], "big") / 2**64 for k in range(3)]
            moves = [(2 * u - 1) * copies["amount"] * 255 for u in shares] * (width * height)
            new = [value + move for value, move in zip(values, moves, strict=True)]
        else:
            philox = np.random.Philox(key=int.from_bytes(drawn("noise")[:16], "big"))
            raw = [int(word) for word in philox.random_raw(-(-len(values) // 4))]
            draws = [word >> shift & 0xFFFF for word in raw for shift in (0, 16, 32, 48)]
            steps = [NormalDist().inv_cdf((d + 0.5) / 65536) for d in draws[: len(values)]]
            new = [v + z * 255 * copies["amount"] for v, z in zip(values, steps, strict=True)]
        whole = np.clip(np.floor(np.array(new) + 0.5), 0, 255).astype(int)
        made.append(whole.reshape(height, width, 3).tolist())
    return H, made


# ---- the page and the program agree ----------------------------------------------------------


def test_the_copies_are_those_of_the_page_and_of_the_program():
    (block,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    told = json.loads(block)
    pixels = [[[0, 128, 255], [10, 20, 30]]]
    for kind in AugmentationKind:
        copies = {"kind": kind.value, "amount": 0.1, "n_copies": 2, "seed": 7}
        assert changed(pixels, copies) == (told["H"], told[kind.value])
    rng = np.random.default_rng(0)
    for kind in AugmentationKind:
        values = rng.integers(0, 256, (5, 7, 3), np.uint8)
        copies = {"kind": kind.value, "amount": 0.25, "n_copies": 3, "seed": 12}
        image = Image.fromarray(values)
        H, made = changed(values.tolist(), copies)
        assert pixel_hash(image) == H
        assert [np.asarray(one).tolist() for one in shifted(image, Copies(**copies))] == made


def test_the_rules_of_reading_are_the_programs():
    assert {word for word, value in VALUE.items() if value > 0} == parse._YES
    assert {word for word, value in VALUE.items() if value < 0} == parse._NO
    assert set(RULES["of a noun"].split()) == parse._OF_A_NOUN
    for name in RULES.keys() - {"yes", "no", "of a noun"}:
        module = thinking if name in ("opens", "closes") else parse
        own = getattr(module, f"_{name.replace(' ', '_').upper()}")
        assert RULES[name] == getattr(own, "pattern", own), name


PIECES = (
    *("yes", "No", "yeah", "true", "open", "it is", "not sure", "No one", "Answer:", "assistant\n"),
    *("<think>", "</think>", "<b>", ",", ".", " - ", "–", "\n", "’", "can't", "tell", "Ｙes", "!"),
    *(
        "no",
        "doubt",
        "wait",
        "Actually",
        "is",
        "The answer",
        "[THINK]",
        "</thinking>",
        "\\boxed{",
        "la",
    ),
)


@given(st.lists(st.sampled_from(PIECES), max_size=7), st.sampled_from(["", " "]))
def test_a_text_says_the_same_by_the_page(pieces, between):
    text = between.join(pieces)
    assert read(text) == {"yes": 1, "no": -1, "invalid": 0}[read_answer(text)]


def test_every_judged_text_is_read_by_the_page_as_it_was_judged():
    table = json.loads(
        Path(__file__).parents[1].joinpath("answer_texts.json").read_text(encoding="utf-8")
    )
    for judged in table.values():
        for said, value in {"yes": 1, "no": -1, "invalid": 0}.items():
            assert {text: read(text) for text in judged.get(said, [])} == dict.fromkeys(
                judged.get(said, []), value
            )


TEXTS = ("Yes", "no", "no.", "maybe", "it is dark")


@pytest.mark.parametrize("kind", list(VoteKind))
@given(data=st.data())
def test_a_reader_of_the_page_gives_every_verdict(kind, data):
    draw = data.draw
    n, n_copies = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    weight = st.integers(1, 5) if kind.weighted else st.just(1)
    threshold = 0.5 if kind is VoteKind.PAPER else draw(st.sampled_from([0.3, 0.5, 0.55, 0.612345]))
    one = recognizer(
        vote=kind,
        threshold=threshold,
        abstain=Abstain(min_sureness=draw(st.sampled_from([0.0, 0.1, 0.25, 0.5, 1.0]))),
        copies=Copies(kind=AugmentationKind.RGB_SHIFT, amount=0.1, n_copies=n_copies, seed=0),
        questions=tuple(
            WeightedQuestion(
                text=f"Is it {q}?", yes_means=draw(st.sampled_from([-1, 1])), weight=draw(weight)
            )
            for q in range(n)
        ),
        calls_per_image=n * n_copies,
    )
    file = json.loads(one.to_bytes())
    p_yes = st.sampled_from([0.0, 0.2, 0.45, 0.5, 0.55, 1 / 3, 0.9, 1.0])
    said = draw(
        st.lists(
            st.lists(st.tuples(st.sampled_from(TEXTS), p_yes), min_size=n, max_size=n),
            min_size=n_copies,
            max_size=n_copies,
        )
    )
    by_call = {
        (number, q["text"]): Answer(*answer)
        for number, copy in enumerate(said)
        for q, answer in zip(file["questions"], copy, strict=True)
    }
    verdict = one.verdict(one.votes(by_call))
    name, _, _, _, agreement, sureness = judged(file, votes(file, said))
    assert (verdict.state_name, verdict.sureness) == (name, sureness)
    if verdict.sureness:
        assert verdict.n_agreeing / n_copies == agreement
    early, n_asked = settled(file, votes(file, said))
    assert early == name
    for number in range(1, n_copies + 1):
        so_far = one.verdict_so_far(one.votes(by_call, n_copies=number))
        assert (so_far is None) == (number < n_asked)
        if so_far is not None:
            assert so_far.state_name == name


def tables():
    """The rows of the page's tables by their first cell."""
    lines = [line.strip("| \n").split(" | ") for line in PAGE.splitlines() if line[:1] == "|"]
    return {cells[0]: cells[1:] for cells in lines}


def test_the_example_is_computed_right():
    one, file = Recognizer.load(EXAMPLE), json.loads(EXAMPLE.read_text(encoding="utf-8"))
    told = tables()
    rows = [told[q["text"]] for q in file["questions"]]
    for q, row in zip(file["questions"], rows, strict=True):
        assert row[:2] == [str(q["weight"]), str(q["yes_means"])]
    said = [[(row[at], float(row[at + 1])) for row in rows] for at in (2, 4)]
    assert [[v for _, v, _ in copy] for copy in votes(file, said)] == [[1, 1, 0], [1, -1, -1]]
    assert judged(file, votes(file, said))[0] == "unknown"
    for kind in VoteKind:
        weights = [q["weight"] if kind.weighted else 1 for q in file["questions"]]
        asked = [q | {"weight": w} for q, w in zip(file["questions"], weights, strict=True)]
        threshold = float(told[kind.value][0])
        changed_file = file | {"vote": kind.value, "threshold": threshold, "questions": asked}
        name, leaning, share, *rest = judged(changed_file, votes(changed_file, said))
        assert told[kind.value][1:3] == [f"{float(share):.4f}", "open" if leaning > 0 else "closed"]
        assert [f"{number:.4f}" for number in rest] == [
            f"{float(cell):.4f}" for cell in told[kind.value][3:]
        ]
        content = {key: value for key, value in changed_file.items() if key != "digest"}
        own = Recognizer.model_validate_json(json.dumps(content))
        by_call = {
            (number, q["text"]): Answer(*answer)
            for number, copy in enumerate(said)
            for q, answer in zip(asked, copy, strict=True)
        }
        assert own.verdict(own.votes(by_call)).state_name == name == "unknown"
    assert one.vote is VoteKind.WEIGHTED_ANSWERS


def test_the_whole_way_from_a_picture():
    """Recognizing asks the model about the copies of the page, one after another."""
    file = json.loads(EXAMPLE.read_text(encoding="utf-8"))
    seen = []
    model = ScriptedModel(
        lambda image, _: seen.append(np.asarray(image).tolist()) or Answer("yes"),
        fingerprint=file["model"]["fingerprint"],
    )
    pixels = np.random.default_rng(3).integers(0, 256, (4, 6, 3), np.uint8)
    verdict = Recognizer.load(EXAMPLE).recognize(Image.fromarray(pixels), model)
    _, made = changed(pixels.tolist(), file["copies"])
    assert [one for n, one in enumerate(seen) if one not in seen[:n]] == made
    said = [[("yes", None)] * 3] * 2
    assert verdict.state_name == judged(file, votes(file, said))[0] == "open"


def test_the_digest_is_that_of_the_canonical_form():
    for one in (Recognizer.load(EXAMPLE), recognizer(name='“é" 🚪')):
        file = json.loads(one.to_bytes())
        assert file.pop("digest") == hashlib.sha256(canonical(file).encode("ascii")).hexdigest()


def canonical(value):
    """Section 7, written out."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{canonical(k)}:{canonical(value[k])}" for k in sorted(value)) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(canonical, value)) + "]"
    if isinstance(value, str):
        units = value.encode("utf-16-be")
        codes = [int.from_bytes(units[at : at + 2], "big") for at in range(0, len(units), 2)]
        escaped = {ord('"'): '\\"', ord("\\"): "\\\\"}
        return (
            '"'
            + "".join(
                escaped.get(code) or (chr(code) if code < 128 else f"\\u{code:04x}")
                for code in codes
            )
            + '"'
        )
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return repr(value)


# ---- the schema ------------------------------------------------------------------------------


def test_every_field_of_the_schema_is_described():
    schema = json.loads((DOCS / "recognizer.schema.json").read_text(encoding="utf-8"))
    of_others = {"SearchSettings", "ObjectiveWeights"}  # described as a whole; how it was searched
    parts = {"": schema} | {k: v for k, v in schema["$defs"].items() if k not in of_others}
    bare = [
        f"{part}.{name}"
        for part, content in parts.items()
        for name, field in content.get("properties", {}).items()
        if not field.get("description")
    ]
    assert bare == []
    assert all(schema["$defs"][name]["description"] for name in of_others)


def test_every_field_that_changes_a_verdict_is_on_the_page():
    for name in (
        "copies",
        "n_copies",
        "amount",
        "yes_means",
        "weight",
        "threshold",
        "min_sureness",
    ):
        assert name in PAGE
    for kind in (*VoteKind, *AugmentationKind):
        assert kind.value in PAGE
