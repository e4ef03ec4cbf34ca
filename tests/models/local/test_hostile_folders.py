"""Folders from anybody: nothing is fetched, no code runs, no file elsewhere is read."""

import json
import re
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from chat_folders import BUILDERS, lacking
from model_zoo import CPU, chat_folder, ofa_folder
from tiny_models import tiny_folder

from vqa_state import models
from vqa_state.errors import ModelError
from vqa_state.models.chat.model import ChatModel
from vqa_state.models.local.blip import BlipModel
from vqa_state.models.local.families import missing_weights
from vqa_state.models.local.folder_files import loaded_files
from vqa_state.models.local.folder_rules import NATIVE_CODE, check_folder, settle, without_network
from vqa_state.models.local.ofa.model import OfaModel
from vqa_state.models.local.runtime import folder_digest
from vqa_state.models.local.vilt import ViltModel

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

KINDS = {"blip": BlipModel, "vilt": ViltModel, "idefics3": ChatModel}
INDEX = "model.safetensors.index.json"


@pytest.fixture
def looked_up(monkeypatch):
    """Machines that were looked for; there is no network here."""
    asked = []

    def refuse(name, *args, **more):
        asked.append(name)
        raise OSError("there is no network here")

    monkeypatch.setattr("socket.getaddrinfo", refuse)
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", False)
    return asked


@pytest.fixture
def kernels(monkeypatch):
    """Stands for the package `kernels`, which fetches native code: what it was asked for."""
    from transformers.integrations import hub_kernels
    from transformers.utils import import_utils

    asked = []

    def get_kernel(name, *args, **more):
        asked.append(name)
        raise OSError("native code would have been fetched")

    for module in (hub_kernels, import_utils):
        monkeypatch.setattr(module, "is_kernels_available", lambda *_, **__: True)
    monkeypatch.setattr(hub_kernels, "get_kernel", get_kernel)
    return asked


@pytest.fixture(params=KINDS)
def family(request):
    return request.param


@pytest.fixture
def folder(family, tmp_path):
    return shutil.copytree(tiny_folder(family), tmp_path / "model")


def edit(folder, file="config.json", part=None, **entries):
    path = folder / file
    content = json.loads(path.read_text()) if path.is_file() else {}
    (content.setdefault(part, {}) if part else content).update(entries)
    path.write_text(json.dumps(content))


def opened(folder):
    return models.create(models.choose(f"folder:{folder}"))


# Code and fetches ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "key"), [(None, "attn_implementation"), ("text_config", "_attn_implementation")]
)
@pytest.mark.parametrize(
    "value", ["evil/kern", "kernels-community/flash-attn", {"": "evil/k@v1:x"}]
)
def test_native_code_of_the_hub_is_refused(data_home, kernels, folder, part, key, value):
    edit(folder, part=part, **{key: value})
    with pytest.raises(ModelError, match=r"config\.json asks for code from the hub, which is ref"):
        opened(folder)
    assert kernels == []


@pytest.mark.parametrize("part", [None, "text_config"])
@pytest.mark.parametrize("key", ["attn_implementation", "experts_implementation"])
@pytest.mark.parametrize(
    "value", ["flash_attention_2", "flash_attention_4", "deepgemm", "sonicmoe"]
)
def test_ways_that_would_fetch_it_are_not_gone(data_home, kernels, folder, part, key, value):
    edit(folder, part=part, **{key: value})
    opened(folder)
    assert kernels == []


@pytest.mark.parametrize("method", ["mxfp4", "fp8", "gguf", None])
def test_weights_that_need_it_are_refused(data_home, kernels, folder, method):
    edit(folder, quantization_config={"quant_method": method})
    with pytest.raises(ModelError, match="asks for code from the hub"):
        opened(folder)
    assert kernels == []


@pytest.mark.parametrize("settings", [{"quant_method": "gptq", "bits": 4}, {"load_in_4bit": True}])
def test_weights_of_few_bits_name_the_package_that_they_need(data_home, folder, settings):
    edit(folder, quantization_config=settings)
    with pytest.raises(ModelError, match="pip install"):
        opened(folder)


@pytest.mark.parametrize("kind", sorted(NATIVE_CODE))
def test_parts_whose_code_fetches_something_are_refused(data_home, folder, kind):
    edit(folder, part="text_config", model_type=kind)
    with pytest.raises(ModelError, match="asks for what only the hub has"):
        opened(folder)


def test_these_are_all_parts_whose_code_fetches_something():
    """Read from the library itself: a new release may have more."""
    home = Path(find_spec("transformers").origin).parent / "models"
    calls = ("get_kernel(", "hf_hub_download(", "load_inline(")
    found = {
        file.parent.name
        for file in home.glob("*/*.py")
        if not file.name.startswith(("convert_", "modular_"))
        for line in file.read_text().splitlines()
        if any(call in line for call in calls) and not line.strip().startswith((">>>", "#"))
    }
    # OneFormer's words are fetched when it is made, which `without_network` keeps it from; what
    # the others have are examples.
    assert found - {"oneformer", "voxtral", "perception_lm"} == NATIVE_CODE


def test_a_processor_that_fetches_when_it_is_made_gets_nothing(data_home, looked_up, tmp_path):
    folder = shutil.copytree(tiny_folder("idefics3"), tmp_path / "model")
    (folder / "processor_config.json").unlink()
    names = {"repo_path": "evil/data", "class_info_file": "x.json", "num_text": 1}
    edit(
        folder, "preprocessor_config.json", image_processor_type="OneFormerImageProcessor", **names
    )
    with pytest.raises(ModelError):
        opened(folder)
    assert looked_up == []


@pytest.mark.parametrize("kind", ["AutoProcessor", "AutoModelForImageTextToText", "AutoTokenizer"])
def test_nothing_in_the_library_gets_to_the_hub_while_it_loads(
    data_home, looked_up, monkeypatch, kind
):
    import transformers
    from huggingface_hub import hf_hub_download

    def fetch(*_, **__):
        return hf_hub_download("evil/data", "x.json")

    monkeypatch.setattr(getattr(transformers, kind), "from_pretrained", fetch)
    with pytest.raises(ModelError):
        opened(tiny_folder("blip" if kind == "AutoTokenizer" else "idefics3"))
    assert looked_up == []


def test_the_hub_can_be_asked_again_afterwards(looked_up):
    from huggingface_hub import get_session

    for n_asked in (1, 2):
        with without_network(), without_network(), pytest.raises(Exception, match="offline"):
            get_session().get("https://hub.invalid")
        with pytest.raises(Exception, match="no network here"):
            get_session().get("https://hub.invalid")
        assert looked_up == ["hub.invalid"] * n_asked


def test_code_of_the_folder_is_neither_run_nor_asked_for(data_home, monkeypatch, folder):
    monkeypatch.setattr("builtins.input", lambda *_: pytest.fail("the user was asked"))
    reference = {"AutoModel": "x.Y", "AutoConfig": "x.Y", "AutoProcessor": "x.Y"}
    (folder / "x.py").write_text("raise SystemExit('code of the folder ran')")
    edit(folder, auto_map=reference)
    edit(folder, part="text_config", auto_map=reference)
    edit(folder, "tokenizer_config.json", auto_map={"AutoTokenizer": ["x.Y", "x.Y"]})
    opened(folder)


def test_no_part_of_a_network_names_code_any_more(folder):
    """A part of a kind that the library has no network for would make it ask the user."""
    from transformers import AutoConfig

    edit(folder, auto_map={"AutoModel": "x.Y"})
    edit(folder, part="text_config", auto_map={"AutoModel": "x.Y"})
    config = AutoConfig.from_pretrained(folder, local_files_only=True, trust_remote_code=False)
    settle(config)
    parts = [config, *(getattr(config, name) for name in config.sub_configs)]
    assert not any(hasattr(part, "auto_map") for part in parts)


# Other files and models ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "entries"),
    [
        ("config.json", {"transformers_weights": "other.safetensors"}),
        ("config.json", {"configuration_files": ["config.4.0.0.json"]}),
        ("tokenizer_config.json", {"fast_tokenizer_files": ["../tokenizer.4.0.0.json"]}),
        ("tokenizer_config.json", {"gguf_file": "../x.gguf"}),
        ("processor_config.json", {"audio_tokenizer": {"audio_tokenizer_class": "AutoModel"}}),
        ("adapter_config.json", {"base_model_name_or_path": "evil/model"}),
        ("audio_tokenizer_config.json", {"audio_tokenizer_class": "AutoModel"}),
    ],
)
def test_names_of_other_files_and_models_are_refused(data_home, folder, file, entries):
    edit(folder, file, **entries)
    with pytest.raises(ModelError, match=re.escape(file)):
        opened(folder)


def test_parts_of_a_training_run_are_refused(data_home, folder):
    weights = (folder / "model.safetensors").read_bytes()
    (folder / "shard-00000-model-00001-of-00001.safetensors").write_bytes(weights)
    with pytest.raises(ModelError, match="parts of a training run"):
        opened(folder)


def in_shards(folder, shard):
    """The folder's weights behind an index, in a file of that name."""
    from safetensors import safe_open

    with safe_open(folder / "model.safetensors", "pt") as file:
        names = list(file.keys())
    (folder / "model.safetensors").rename(folder / shard)
    index = {"metadata": {}, "weight_map": dict.fromkeys(names, shard)}
    (folder / INDEX).write_text(json.dumps(index))
    return folder


@pytest.mark.parametrize(
    "shard", ["../outside.safetensors", "/m/x.safetensors", "a\\b.safetensors", "weights.bin", 5]
)
def test_weights_elsewhere_are_refused(data_home, folder, shard):
    index = {"weight_map": {"a": shard}}
    (folder / "model.safetensors").unlink()
    (folder / INDEX).write_text(json.dumps(index))
    for act in (missing_weights, folder_digest, opened):
        with pytest.raises(ModelError, match="weights are files of the same folder"):
            act(folder)


def test_ofa_refuses_them_too(tmp_path):
    folder = shutil.copytree(ofa_folder(tmp_path), tmp_path / "copy")
    (folder / "model.safetensors").rename(tmp_path / "outside.safetensors")
    (folder / INDEX).write_text(json.dumps({"weight_map": {"a": "../outside.safetensors"}}))
    with pytest.raises(ModelError, match="weights are files of the same folder"):
        OfaModel(folder, "folder:ofa", CPU)


@pytest.mark.parametrize("content", [[], {}, {"weight_map": []}])
def test_an_index_that_is_none(folder, content):
    (folder / "model.safetensors").unlink()
    (folder / INDEX).write_text(json.dumps(content))
    with pytest.raises(ModelError, match="is damaged"):
        missing_weights(folder)


def test_weights_in_shards_are_read_and_told(folder, family):
    whole = KINDS[family](folder, "x", CPU)
    in_shards(folder, "part-1.safetensors")
    split = KINDS[family](folder, "x", CPU)
    assert split.fingerprint != whole.fingerprint
    with (folder / "part-1.safetensors").open("r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x01")
    assert KINDS[family](folder, "x", CPU).fingerprint != split.fingerprint


# What is read is told, and nothing else -----------------------------------------------------


@pytest.fixture
def reads():
    """Files that Python opens, while it is on. Weights and words are read below Python."""
    opened = []
    _LISTENERS.append(opened)
    yield opened
    _LISTENERS.remove(opened)


_LISTENERS = []


def _listen(event, arguments):
    if event == "open" and _LISTENERS and isinstance(arguments[0], str | Path):
        for one in _LISTENERS:
            one.append(Path(arguments[0]))


sys.addaudithook(_listen)


@pytest.mark.parametrize("family_name", ["blip", "vilt", *BUILDERS])
def test_all_files_that_are_read_are_in_the_digest(family_name, tmp_path, reads):
    if lacking(family_name):
        pytest.skip(f"needs {', '.join(lacking(family_name))}")
    is_classic = family_name in ("blip", "vilt")
    source = tiny_folder(family_name) if is_classic else chat_folder(family_name, tmp_path)
    folder = shutil.copytree(source, tmp_path / "copy")
    told = set(loaded_files(folder))
    (folder / "README.txt").write_text("words")
    reads.clear()
    KINDS.get(family_name, ChatModel)(folder, "x", CPU)
    read = {path for path in reads if path.is_relative_to(folder) and path.is_file()}
    assert folder / "config.json" in read
    assert read <= told


@pytest.mark.parametrize(
    "other", ["README.txt", "README.md", "onnx/q.json", "other.safetensors", ".git/config.json"]
)
def test_what_is_not_read_changes_nothing(folder, other):
    before = folder_digest(folder)
    (folder / other).parent.mkdir(exist_ok=True)
    (folder / other).write_text('{"a": 1}')
    assert folder_digest(folder) == before


@pytest.mark.parametrize(
    "file",
    [
        *("config.json", "generation_config.json", "preprocessor_config.json"),
        *("processor_config.json", "video_preprocessor_config.json", "tokenizer.json"),
        *("tokenizer_config.json", "tokenizer.4.0.0.json", "special_tokens_map.json"),
        *("added_tokens.json", "vocab.json", "vocab.txt", "merges.txt", "tokenizer.model"),
        *("spiece.model", "sentencepiece.bpe.model", "chat_template.json", "chat_template.jinja"),
        *("additional_chat_templates/default.jinja", "qformer_tokenizer/tokenizer.json"),
        "model.safetensors",
    ],
)
def test_what_is_read_changes_it(tmp_path, file):
    (tmp_path / "config.json").write_text("{}")
    before = folder_digest(tmp_path)
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text('{"a": 1}')
    assert folder_digest(tmp_path) != before


# Damage -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("family_name", "damage"),
    [
        ("blip", {"text_config": 5}),
        ("blip", {"vision_config": {"patch_size": 0}}),
        ("blip", {"vision_config": []}),
        ("vilt", {"patch_size": 0}),
        ("vilt", {"hidden_size": -1}),
        ("vilt", {"num_hidden_layers": "many"}),
        ("vilt", {"id2label": 7}),
        ("idefics3", {"text_config": 5}),
        ("idefics3", {"vision_config": {"patch_size": 0}}),
        ("idefics3", {"scale_factor": 0}),
        ("ofa", {"d_model": 0}),
        ("ofa", {"vocab_size": 10**12}),
    ],
)
def test_a_damaged_configuration_is_told_in_words(data_home, tmp_path, family_name, damage):
    source = ofa_folder(tmp_path) if family_name == "ofa" else tiny_folder(family_name)
    folder = shutil.copytree(source, tmp_path / "copy")
    edit(folder, **damage)
    with pytest.raises(ModelError):
        opened(folder)


def test_a_healthy_folder_passes(folder):
    check_folder(folder)
