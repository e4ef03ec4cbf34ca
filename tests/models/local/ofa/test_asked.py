"""OFA as a model: asked about images, and loaded from folders whole or damaged."""

import json
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import ofa_weights
import pytest
import torch
from ofa_golden import CPU, GOLDEN, QUESTIONS, REFERENCE, encode, variant, write_folder
from PIL import Image
from safetensors.torch import load_file, save_file

from vqa_state.errors import ModelError
from vqa_state.models import Failure
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.ofa import model as model_module
from vqa_state.models.local.ofa.config import DecoderPrompt, read_folder
from vqa_state.models.local.ofa.decoding import start
from vqa_state.models.local.ofa.loading import content_digest, convert_checkpoint, load_network
from vqa_state.models.local.ofa.model import OfaModel
from vqa_state.models.local.ofa.tokenizer import OfaTokenizer
from vqa_state.models.local.runtime import Runtime


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("ofa")
    write_folder(made)
    return made


@pytest.fixture(scope="module")
def network(folder):
    return load_network(folder, read_folder(folder)[0], torch.float32)


@pytest.fixture(scope="module")
def ofa(folder):
    return OfaModel(folder, "folder:ofa", CPU)


def test_the_model_says_the_best_answer_of_the_reference(ofa):
    image = Image.fromarray(ofa_weights.picture(7, 64, 64))
    replies = sorted(ofa.answer([image], QUESTIONS), key=lambda reply: reply.question)
    tokenizer = OfaTokenizer(GOLDEN)
    # Longer answers are allowed here, so only those that ended early must be the same.
    ended = [row[0][0] for row in REFERENCE["beams"]["none"] if len(row[0][0]) < 3]
    texts = [reply.outcome.text for reply in replies]
    assert ended
    assert {tokenizer.decode(tokens).strip() for tokens in ended} <= set(texts)


def test_together_or_alone_the_answers_are_the_same(ofa, monkeypatch):
    images = [Image.fromarray(ofa_weights.picture(n, 30, 40)) for n in range(2)]
    monkeypatch.setattr(model_module, "_MAX_QUESTIONS", 2)
    together = {
        (reply.image, reply.question): reply.outcome
        for reply in ofa.answer(images, [*QUESTIONS, QUESTIONS[0]])
    }
    assert set(together) == {(i, q) for i in range(2) for q in range(8)}
    for (i, q), outcome in together.items():
        (alone,) = ofa.answer([images[i]], [[*QUESTIONS, QUESTIONS[0]][q]])
        assert alone.outcome.text == outcome.text
        assert alone.outcome.p_yes == pytest.approx(outcome.p_yes, abs=2e-6)


def test_p_yes_is_that_of_the_first_token(ofa, network, folder):
    image = Image.fromarray(ofa_weights.picture(7, 64, 64))
    (reply,) = ofa.answer([image], [QUESTIONS[0]])
    tokenizer = OfaTokenizer(folder)
    ids = [tokenizer.encode(word) for word in (" yes", " no")]
    assert [len(tokens) for tokens in ids] == [1, 1]
    tokens = REFERENCE["beams"]["tokens"][0]
    with torch.inference_mode():
        _, logits = start(network.decoder, encode(network, tokens), torch.tensor([[0]]))
        yes, no = logits[0, [ids[0][0], ids[1][0]]].softmax(0).tolist()
    assert reply.outcome.p_yes == pytest.approx(yes, abs=2e-6)
    assert yes + no == pytest.approx(1)


def test_every_kind_of_picture_and_question_gives_one_reply(ofa):
    images = [
        Image.new("L", (1, 1)),
        Image.new("P", (3, 500)),
        Image.new("RGB", (8000, 20), "red"),
        Image.new("RGBA", (20, 8000)),
    ]
    questions = ["", "Is it open?", "why " * 200, "</s> 🚪"]
    replies = list(ofa.answer(images, questions))
    assert sorted((r.image, r.question) for r in replies) == [
        (i, q) for i in range(4) for q in range(4)
    ]
    failed = {r.question for r in replies if isinstance(r.outcome, Failure)}
    assert failed == {2}
    assert "at most 130" in next(r.outcome.reason for r in replies if r.question == 2)


def test_nothing_asked_nothing_answered(ofa):
    assert list(ofa.answer([], ["is it open?"])) == []
    assert list(ofa.answer([Image.new("RGB", (9, 9))], [])) == []


def test_an_image_is_seen_once_and_replies_come_after_each_batch(folder, monkeypatch):
    ofa = OfaModel(folder, "folder:ofa", CPU)
    seen = []
    see = ofa._network.encoder.see
    monkeypatch.setattr(ofa._network.encoder, "see", lambda x: (seen.append(1), see(x))[1])
    asked = []
    ask = ofa._ask
    monkeypatch.setattr(ofa, "_ask", lambda *args: (asked.append(len(args[1])), ask(*args))[1])
    monkeypatch.setattr(model_module, "_MAX_QUESTIONS", 3)
    replies = ofa.answer([Image.new("RGB", (9, 9))], [f"is it {n}?" for n in range(8)])
    next(replies)
    assert asked == [3]
    assert not ofa._turns.lock.locked()
    assert len(list(replies)) == 7
    assert (seen, asked) == ([1], [3, 3, 2])


def test_threads_share_one_model(ofa):
    images = [Image.fromarray(ofa_weights.picture(n, 20, 20)) for n in range(3)]
    alone = [list(ofa.answer([image], QUESTIONS[:3])) for image in images]
    found = {}

    def work(n):
        found[n] = list(ofa.answer([images[n]], QUESTIONS[:3]))

    threads = [threading.Thread(target=work, args=(n,)) for n in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[n] for n in range(3)] == alone


def test_each_decoder_prompt_and_given_answers_change_the_answer(folder, tmp_path):
    image = Image.fromarray(ofa_weights.picture(7, 64, 64))
    sure = {}
    for kind in DecoderPrompt:
        ofa = OfaModel(variant(folder, tmp_path / kind, prompt_type=kind), "x", CPU)
        (reply,) = ofa.answer([image], [QUESTIONS[0]])
        sure[kind] = reply.outcome.p_yes
        assert f"decoder reads {kind}" in ofa.fingerprint
    assert len(set(sure.values())) == 3
    given = variant(folder, tmp_path / "given", answers=["yes", "no"])
    (reply,) = OfaModel(given, "x", CPU).answer([image], [QUESTIONS[0]])
    assert reply.outcome.p_yes == sure[DecoderPrompt.NONE]
    assert reply.outcome.text == ("yes" if reply.outcome.p_yes > 0.5 else "no")


def test_a_prompt_surrounds_the_question(folder, ofa):
    image = Image.fromarray(ofa_weights.picture(7, 64, 64))
    asked = OfaModel(folder, "x", CPU, prompt="Look. {question}")
    (with_prompt,) = asked.answer([image], ["is it open?"])
    (by_hand,) = ofa.answer([image], ["Look. is it open?"])
    assert with_prompt == by_hand
    assert asked.fingerprint != ofa.fingerprint


def test_bfloat16_runs(folder):
    ofa = OfaModel(folder, "x", Runtime(Device.CPU, Precision.BFLOAT16))
    (reply,) = ofa.answer([Image.new("RGB", (9, 9))], ["is it open?"])
    assert 0 <= reply.outcome.p_yes <= 1
    assert "bfloat16" in ofa.fingerprint


# Folders


def test_conversion_gives_the_same_bytes_anywhere_and_the_folder_no_part_of_the_fingerprint(
    folder, tmp_path, ofa
):
    there = convert_checkpoint(folder, tmp_path / "new" / "folder")
    assert there.read_bytes() == (folder / "model.safetensors").read_bytes()
    moved = OfaModel(variant(folder, tmp_path / "moved"), "other", CPU)
    assert (
        moved.fingerprint
        == OfaModel(folder, "x", CPU).fingerprint
        == ofa.fingerprint.replace(content_digest(folder), content_digest(tmp_path / "moved"))
    )
    assert str(tmp_path) not in moved.fingerprint


def test_an_unconverted_folder_names_the_command(folder, tmp_path):
    raw = tmp_path / "raw"
    shutil.copytree(folder, raw, ignore=shutil.ignore_patterns("*.safetensors"))
    with pytest.raises(ModelError, match="vqa_state models convert"):
        OfaModel(raw, "x", CPU)
    convert_checkpoint(raw)
    assert OfaModel(raw, "x", CPU).fingerprint == OfaModel(folder, "x", CPU).fingerprint


class Bomb:
    def __reduce__(self):
        return (Path.touch, (Path("exploded"),))


@pytest.mark.parametrize("content", ["bomb", "garbage", "nested", "untied", "missing"])
def test_a_checkpoint_that_is_not_only_weights_is_refused(content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "pytorch_model.bin"
    one, two = torch.zeros(2), torch.ones(2)
    tables = {"encoder.embed_tokens.weight": one, "decoder.embed_tokens.weight": two}
    content = {"bomb": {"a": Bomb()}, "nested": {"model": {"a": one}}, "untied": tables}.get(
        content, content
    )
    if content == "garbage":
        path.write_bytes(b"PK\x03\x04 no archive")
    elif content != "missing":
        torch.save(content, path)
    with pytest.raises(ModelError, match=r"pytorch_model\.bin"):
        convert_checkpoint(tmp_path)
    assert not (tmp_path / "exploded").exists()
    assert not list(tmp_path.glob("model*"))


def test_weights_in_shards(folder, tmp_path):
    shards = variant(folder, tmp_path / "shards")
    state = load_file(shards / "model.safetensors")
    names = sorted(state)
    (shards / "model.safetensors").unlink()
    where = {}
    for number, part in enumerate((names[:50], names[50:])):
        save_file({name: state[name] for name in part}, shards / f"part{number}.safetensors")
        where |= dict.fromkeys(part, f"part{number}.safetensors")
    (shards / "model.safetensors.index.json").write_text(json.dumps({"weight_map": where}))
    image = Image.fromarray(ofa_weights.picture(7, 64, 64))
    ask = [list(OfaModel(one, "x", CPU).answer([image], QUESTIONS[:2])) for one in (folder, shards)]
    assert ask[0] == ask[1]


@pytest.mark.parametrize("damage", ["short", "lacks one", "other shape", "no vocab", "bad merge"])
def test_damage_is_named(folder, tmp_path, damage):
    broken = variant(folder, tmp_path / "broken")
    weights = broken / "model.safetensors"
    state = load_file(weights)
    if damage == "short":
        weights.write_bytes(weights.read_bytes()[:-100])
    elif damage == "lacks one":
        del state["encoder.pos_ln.weight"]
        save_file(state, weights)
    elif damage == "other shape":
        state["encoder.pos_ln.weight"] = torch.zeros(3)
        save_file(state, weights)
    elif damage == "no vocab":
        (broken / "vocab.json").unlink()
    else:
        (broken / "merges.txt").write_text("#version\nzzz qqq\n")
    with pytest.raises(ModelError):
        OfaModel(broken, "x", CPU)


@pytest.mark.parametrize(
    "said",
    [
        {"normformer": False},
        {"use_ofasys": True},
        {"attn_scale_factor": 1.0},
        {"d_model": 30},
        {"encoder_layers": 0},
        {"decoder_layers": "2"},
        {"resnet_type": "vit"},
        {"prompt_type": "both"},
        {"patch_image_size": 9000},
        {"max_src_length": -1},
        {"answers": "yes"},
        {"answers": ["yes", "yes"]},
        {"vocab_size": 100},
    ],
)
def test_a_config_that_cannot_be_run_is_refused(folder, tmp_path, said):
    changed = variant(folder, tmp_path / "changed", **said)
    with pytest.raises(ModelError, match=f"{next(iter(said))}|config"):
        OfaModel(changed, "x", CPU)


def test_modelscope_says_its_style_in_a_file_of_its_own(folder, tmp_path):
    changed = variant(folder, tmp_path / "changed")
    style = {"prompt_type": "prev_output", "patch_image_size": 384, "type": "ofa"}
    (changed / "configuration.json").write_text(json.dumps({"model": style}))
    found = read_folder(changed)[1]
    assert found.prompt_type is DecoderPrompt.PREV_OUTPUT
    assert found.patch_image_size == 64  # config.json wins


def test_naming_the_class_loads_nothing_heavy():
    code = (
        "import sys, vqa_state.models.local.ofa.model; "
        "print([n for n in ('torch', 'tokenizers', 'transformers', 'safetensors') "
        "if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
