"""Writes the golden files beside it: what the authors' own implementation of OFA computes.

    python make_golden.py REFERENCE ORIGINAL

REFERENCE is the folder `transformers/src` of branch `feature/add_transformers` of
github.com/OFA-Sys/OFA (transformers 4.18.0.dev0 with OFA in it), ORIGINAL a checkout of its
branch `main` (for the cleaning of questions and the trie of answers). Neither is part of this
repository. It was run in an environment of its own: the versions stand in golden.json.
"""

import hashlib
import json
import platform
import sys
import types
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent.parent))

import ofa_weights  # noqa: E402

QUESTIONS = [
    "Is this door open?",
    "is the refrigerator door closed",
    "Does this image look like the elevator door is closed?",
    "Is water running?",
    "Is this display on?",
    "Is this  TV-monitor/display turned on ?",
    "Can you see a gap at the door's edge?",
]
RAW = [
    *QUESTIONS,
    "",
    "?",
    "...is it open?",
    "#:;~ what",
    "  Is\tit\n\nopen \n",
    "IS IT OPEN!?",
    "it's 12 o'clock, isn't it?",
    "Ist die Tür geöffnet?",
    "ドアは開いていますか?",
    "emoji 🚪 open?",
    "semi-open/half-closed",
    "-is it-",
    "trailing newline\n",
]
ANSWERS = ["yes", "no", "closed", "yes it is", "yes it", "the door"]
MAX_LENGTH = 8


def main(reference, original):
    sys.path.insert(0, reference)
    import torch
    import transformers

    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    make_vocabulary()
    tokenizer, model, n_words = build()
    clean = cleaning(original)
    tokens = [tokenizer(clean(text)).input_ids for text in QUESTIONS]
    golden = {
        "made_by": {
            "python": platform.python_version(),
            "torch": torch.__version__,
            "transformers": transformers.__version__,
            "numpy": np.__version__,
        },
        "keys": {name: key_digest(name) for name in ofa_weights.SIZES},
        "buffers": buffers(),
        "cleaned": [[text, clean(text)] for text in RAW],
        "tokens": [[clean(text), tokenizer(clean(text)).input_ids] for text in RAW],
        "decoded": decoded(tokenizer, n_words),
        "pixels": pixels(),
        "forward": [forward(model, tokens[:1], 64), forward(model, tokens[2:3], 96)],
        "padded": forward(model, tokens, 64),
        "beams": beams(tokenizer, model, tokens, n_words),
        "answers": answers(original, tokenizer, model, tokens),
    }
    (HERE / "golden.json").write_text(json.dumps(golden, separators=(",", ":")))


def make_vocabulary():
    """A small vocabulary with merges learned from the questions, in the form of the public one."""
    from tokenizers import ByteLevelBPETokenizer

    trained = ByteLevelBPETokenizer()
    texts = [f" {text.lower()}" for text in QUESTIONS * 3] + [f" {text}" for text in ANSWERS * 9]
    trained.train_from_iterator(texts, vocab_size=400, min_frequency=2)
    trained.save_model(str(HERE))
    words = json.loads((HERE / "vocab.json").read_text())
    ordered = ["<s>", "<pad>", "</s>", "<unk>", *sorted(words, key=words.get), "<mask>"]
    numbers = {word: number for number, word in enumerate(ordered)}
    (HERE / "vocab.json").write_text(json.dumps(numbers, ensure_ascii=False))


def build():
    import torch
    from transformers.models.ofa.configuration_ofa import OFAConfig
    from transformers.models.ofa.modeling_ofa import OFAModel
    from transformers.models.ofa.tokenization_ofa import OFATokenizer

    n_words = len(json.loads((HERE / "vocab.json").read_text()))
    config = OFAConfig(**ofa_weights.small_config(n_words), architectures=["OFAModel"])
    config.save_pretrained(HERE)
    model = OFAModel(config).eval()
    state = model.state_dict()
    shapes = {name: value.shape for name, value in state.items()}
    for name, value in ofa_weights.learned_weights(shapes, n_words).items():
        state[name].copy_(torch.from_numpy(value))
    table = state["encoder.embed_tokens.weight"]
    assert state["decoder.output_projection.weight"].equal(table)
    return OFATokenizer.from_pretrained(HERE), model, n_words


def key_digest(size):
    """Names and shapes of a public size's state dict, and how many weights that is."""
    import torch
    from transformers.models.ofa.configuration_ofa import OFAConfig
    from transformers.models.ofa.modeling_ofa import OFAModel

    linspace = torch.linspace
    torch.linspace = lambda *args: linspace(*args, device="cpu")  # it asks for their values
    try:
        with torch.device("meta"):
            model = OFAModel(OFAConfig(**ofa_weights.sizes_config(size)))
    finally:
        torch.linspace = linspace
    lines = [f"{name} {list(value.shape)}" for name, value in sorted(model.state_dict().items())]
    return {
        "n_keys": len(lines),
        "n_weights": sum(parameter.numel() for parameter in model.parameters()),
        "sha256": hashlib.sha256("\n".join(lines).encode()).hexdigest(),
    }


def buffers():
    """The calculated tables of every public size: they have one number of buckets in common."""
    from transformers.models.ofa.configuration_ofa import OFAConfig
    from transformers.models.ofa.modeling_ofa import OFAModel

    model = OFAModel(OFAConfig(d_model=8, encoder_layers=1, decoder_layers=1))
    return {
        name: hashlib.sha256(value.numpy().astype("<i8").tobytes()).hexdigest()
        for name, value in model.named_buffers()
        if name.endswith(("_bucket", "position_idx"))
    }


def cleaning(original):
    """The authors' own function, and the two steps that their VQA data set does after it."""
    fairseq = types.ModuleType("fairseq")
    fairseq.data = types.ModuleType("fairseq.data")
    fairseq.data.FairseqDataset = object
    sys.modules |= {"fairseq": fairseq, "fairseq.data": fairseq.data}
    source = Path(original, "data", "ofa_dataset.py")
    module = types.ModuleType("ofa_dataset")
    exec(compile(source.read_text(), source, "exec"), module.__dict__)

    def clean(text):
        text = module.OFADataset.pre_question(None, text)
        return " {}".format(text if text.endswith("?") else text + "?")

    return clean


def decoded(tokenizer, n_words):
    cases = [[0, 5, 70, 71, 2], [n_words], [40, n_words + 8191, n_words + 8192, 41, 2, 1, 1]]
    return [[case, tokenizer.decode(case, skip_special_tokens=True).strip()] for case in cases]


def pixels():
    from PIL import Image
    from torchvision import transforms

    transform = transforms.Compose(
        [
            lambda image: image.convert("RGB"),
            transforms.Resize((16, 16), interpolation=transforms.InterpolationMode.BICUBIC),
            transforms.ToTensor(),
            transforms.Normalize(mean=[0.5] * 3, std=[0.5] * 3),
        ]
    )
    image = Image.fromarray(ofa_weights.picture(3, 37, 50))
    modes = [image, image.convert("L"), image.quantize(9), image.resize((1, 1))]
    return [numbers(transform(one)[:, ::3, ::2]) for one in modes]


def patches(side):
    import torch

    image = ofa_weights.picture(7, side, side).astype(np.float32) / 127.5 - 1
    return torch.from_numpy(image).permute(2, 0, 1)[None]


def batch(tokens, side):
    import torch

    longest = max(map(len, tokens))
    rows = [row + [1] * (longest - len(row)) for row in tokens]
    n = len(rows)
    return {
        "input_ids": torch.tensor(rows),
        "patch_images": patches(side).expand(n, -1, -1, -1),
        "patch_masks": torch.tensor([True] * n),
    }


def forward(model, tokens, side):
    """Encoder states and logits of the words after the question, read again by the decoder."""
    import torch

    data = batch(tokens, side)
    encoded = model.encoder(**data)
    words = torch.tensor([[0, 30, 41, 52, 63]] * len(tokens))
    logits = model(**data, decoder_input_ids=words).logits
    return {
        "side": side,
        "tokens": tokens,
        "words": words[0].tolist(),
        "states": numbers(encoded.last_hidden_state[:1, ::5]),
        "places": numbers(encoded.position_embedding[:1, ::5]),
        "logits": numbers(logits[:, :, ::397]),
    }


class AnyWord:
    """A trie that allows everything: with one, the reference forces a prefix exactly."""

    def __init__(self, n_words):
        self.words = list(range(n_words))

    def get_next_layer(self, _):
        return self.words


def generate(tokenizer, model, tokens, prefix=None, **settings):
    import torch
    from transformers.models.ofa.generate.sequence_generator import SequenceGenerator

    generator = SequenceGenerator(tokenizer, **settings)
    prefix = torch.tensor(prefix) if prefix and prefix[0] else None
    found = generator.generate([model], {"net_input": batch(tokens, 64)}, prefix_tokens=prefix)
    skip = prefix.shape[1] if prefix is not None else 0
    return [[answer_of(one, skip) for one in answers] for answers in found]


def answer_of(found, skip):
    steps = found["positional_scores"][skip:]
    return [found["tokens"][skip:-1].tolist(), numbers(steps.sum()), numbers(found["score"])]


def beams(tokenizer, model, tokens, n_words):
    """Five answers to each question, asked one by one; and all asked in one padded batch."""
    vqa = {"beam_size": 5, "max_len_b": MAX_LENGTH, "normalize_scores": False}
    example = {"beam_size": 5, "max_len_b": MAX_LENGTH, "min_len": 0, "no_repeat_ngram_size": 3}
    any_word = AnyWord(n_words + ofa_weights.N_CODES)
    one_by_one = [
        generate(
            tokenizer,
            model,
            [row],
            [row[1:-1]],
            **vqa | {"max_len_b": MAX_LENGTH + len(row) - 2, "constraint_trie": any_word},
        )[0]
        for row in tokens
    ]
    without_trie = [
        generate(
            tokenizer, model, [row], [row[1:-1]], **vqa | {"max_len_b": MAX_LENGTH + len(row) - 2}
        )[0]
        for row in tokens
    ]
    return {
        "tokens": tokens,
        "none": [generate(tokenizer, model, [row], **vqa)[0] for row in tokens],
        "none_padded": generate(tokenizer, model, tokens, **vqa),
        "example": [generate(tokenizer, model, [row], **example)[0] for row in tokens],
        "prev_output": one_by_one,
        "n_best_changed_without_trie": sum(
            a[0][0] != b[0][0]
            for a, b in zip(one_by_one, without_trie)  # noqa: B905
        ),
    }


def answers(original, tokenizer, model, tokens):
    """Log-probabilities of given answers: a beam as wide as their number finds every one."""
    source = Path(original, "utils", "trie.py")
    module = types.ModuleType("trie")
    exec(compile(source.read_text(), source, "exec"), module.__dict__)
    words = [tokenizer(f" {text}", add_special_tokens=False).input_ids for text in ANSWERS]
    trie = module.Trie(2)
    for row in words:
        trie.insert([0, *row, 2])
    settings = {"beam_size": len(ANSWERS), "normalize_scores": False, "constraint_trie": trie}
    result = {"texts": ANSWERS, "words": words}
    for prompt in ("none", "prev_output"):
        result[prompt] = []
        for row in tokens:
            prefix = [row[1:-1]] if prompt == "prev_output" else None
            length = 12 + (len(prefix[0]) if prefix else 0)
            found = generate(tokenizer, model, [row], prefix, max_len_b=length, **settings)[0]
            scores = {tuple(ids): score for ids, score, _ in found if np.isfinite(score)}
            result[prompt].append([scores[tuple(ids)] for ids in words])
    return result


def numbers(tensor):
    return np.round(tensor.double().numpy(), 6).tolist()


if __name__ == "__main__":
    main(*sys.argv[1:])
