"""Tiny chat models with random weights, one folder a family, made on the spot.

Some processors hold a processor of videos, which needs torchvision; SmolVLM's needs num2words.
`BUILDERS` names them all, `NEEDS` what each needs beyond our own requirements.
"""

import math
from importlib.util import find_spec

import torch
import transformers as hf
from tokenizers import Tokenizer, decoders, models, pre_tokenizers

from benchmarks.model_folders import build_idefics3

ANSWERS = ("yes", "no", "Yes", "No", "open", "closed", "door", "light", "two", "left")
WORDS = ("is", "the", "this", "on", "off", "water", "sink", "image", "Answer", "or", "answer", "en")


def tokenizer(controls, **named):
    """Byte-level pieces and some whole words; the last control token ends an answer."""
    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    words = [spelling for word in (*ANSWERS, *WORDS) for spelling in (word, "Ġ" + word)]
    pieces = list(dict.fromkeys(letters))
    merges = []
    for word in words:
        for end in range(2, len(word) + 1):
            if word[:end] not in pieces:
                pieces.append(word[:end])
                merges.append((word[: end - 1], word[end - 1]))
    vocabulary = {piece: number for number, piece in enumerate([*controls, *pieces])}
    bare = Tokenizer(models.BPE(vocab=vocabulary, merges=merges))
    bare.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    bare.decoder = decoders.ByteLevel()
    bare.add_special_tokens(list(controls))
    return hf.PreTrainedTokenizerFast(
        tokenizer_object=bare,
        pad_token=controls[0],
        bos_token=controls[1],
        eos_token=controls[2],
        padding_side="left",
        **named,
    )


def save(folder, kind, config, processor, *, seed=2, embedding=0.3):
    """Weights so far apart that images and questions change what is said, and for how long."""
    with torch.random.fork_rng(devices=[]):
        model = kind(config).eval()
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, weight in model.named_parameters():
            if "norm" in name.lower() or weight.ndim < 2:
                continue
            is_looked_up = "embed" in name and "patch" not in name
            std = embedding if is_looked_up else 1 / math.sqrt(weight[0].numel())
            gain = 2.5 if any(part in name for part in ("q_proj", "k_proj", "qkv")) else 1.0
            weight.normal_(std=gain * std, generator=generator)
        said = [processor.tokenizer.convert_tokens_to_ids(word) for word in ANSWERS]
        head = model.get_output_embeddings().weight
        head[[*said, processor.tokenizer.eos_token_id]] *= 4.0
    model.generation_config.eos_token_id = processor.tokenizer.eos_token_id
    model.generation_config.pad_token_id = processor.tokenizer.pad_token_id
    model.save_pretrained(folder)
    processor.save_pretrained(folder)
    return folder


def text_config(tokens, **more):
    return {
        "hidden_size": 64,
        "intermediate_size": 96,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        "num_key_value_heads": 2,
        "head_dim": 16,
        "vocab_size": len(tokens),
        "max_position_embeddings": 1024,
        "pad_token_id": tokens.pad_token_id,
        "bos_token_id": tokens.bos_token_id,
        "eos_token_id": tokens.eos_token_id,
        **more,
    }


def vision_config(**more):
    return {
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        **more,
    }


def chat_template(image, start="<s>", end="</s>\n"):
    return (
        "{% for message in messages %}" + start + "{{ message['role'] }}:"
        "{% for part in message['content'] %}{% if part['type'] == 'image' %}" + image + "\n"
        "{% else %}{{ part['text'] | trim }}{% endif %}{% endfor %}" + end + "{% endfor %}"
        "{% if add_generation_prompt %}" + start + "assistant:{% endif %}"
    )


def build_smolvlm(folder):
    from transformers.models.smolvlm.image_processing_pil_smolvlm import SmolVLMImageProcessorPil

    tiles = [f"<row_{row}_col_{column}>" for row in range(1, 7) for column in range(1, 7)]
    controls = ["<pad>", "<s>", "</s>", "<fake_token_around_image>", "<image>", "<global-img>"]
    tokens = tokenizer([*controls, "<end_of_utterance>", *tiles])
    config = hf.SmolVLMConfig(
        text_config=text_config(tokens, model_type="llama"),
        vision_config=vision_config(image_size=64, patch_size=16),
        image_token_id=tokens.convert_tokens_to_ids("<image>"),
        scale_factor=2,
        pad_token_id=tokens.pad_token_id,
        tie_word_embeddings=False,
    )
    images = SmolVLMImageProcessorPil(
        size={"longest_edge": 128}, max_image_size={"longest_edge": 64}, do_image_splitting=True
    )
    processor = hf.SmolVLMProcessor(
        images,
        tokens,
        hf.SmolVLMVideoProcessor(),
        image_seq_len=4,
        chat_template=chat_template("<image>", end="<end_of_utterance>\n"),
    )
    return save(folder, hf.SmolVLMForConditionalGeneration, config, processor)


_QWEN_VISION = {
    "depth": 2,
    "hidden_size": 32,
    "intermediate_size": 64,
    "num_heads": 4,
    "out_hidden_size": 64,
}


def _qwen_parts():
    controls = ["<pad>", "<s>", "</s>", "<|vision_start|>", "<|vision_end|>"]
    tokens = tokenizer([*controls, "<|image_pad|>", "<|video_pad|>"])
    names = ("image", "video", "vision_start", "vision_end")
    written = ("<|image_pad|>", "<|video_pad|>", "<|vision_start|>", "<|vision_end|>")
    ids = {
        f"{name}_token_id": tokens.convert_tokens_to_ids(token)
        for name, token in zip(names, written, strict=True)
    }
    return tokens, ids, chat_template("<|vision_start|><|image_pad|><|vision_end|>")


def _qwen_images(patch):
    from transformers.models.qwen2_vl.image_processing_pil_qwen2_vl import Qwen2VLImageProcessorPil

    small, large = 16 * patch * patch, 64 * patch * patch
    return Qwen2VLImageProcessorPil(
        patch_size=patch, merge_size=2, temporal_patch_size=2, min_pixels=small, max_pixels=large
    )


def build_qwen25(folder):
    tokens, ids, template = _qwen_parts()
    rope = {"rope_type": "default", "mrope_section": [2, 3, 3], "rope_theta": 1e6}
    vision = {
        **_QWEN_VISION,
        "patch_size": 14,
        "window_size": 112,
        "fullatt_block_indexes": [1],
    }
    config = hf.Qwen2_5_VLConfig(
        text_config=text_config(tokens, rope_parameters=rope), vision_config=vision, **ids
    )
    processor = hf.Qwen2_5_VLProcessor(
        _qwen_images(14), tokens, hf.Qwen2VLVideoProcessor(patch_size=14), chat_template=template
    )
    return save(folder, hf.Qwen2_5_VLForConditionalGeneration, config, processor)


def build_qwen3(folder):
    tokens, ids, template = _qwen_parts()
    rope = {"rope_type": "default", "mrope_section": [4, 2, 2], "rope_theta": 5e6}
    rope["mrope_interleaved"] = True
    vision = {
        **_QWEN_VISION,
        "patch_size": 16,
        "num_position_embeddings": 64,
        "deepstack_visual_indexes": [0, 1],
    }
    config = hf.Qwen3VLConfig(
        text_config=text_config(tokens, rope_parameters=rope), vision_config=vision, **ids
    )
    processor = hf.Qwen3VLProcessor(
        _qwen_images(16), tokens, hf.Qwen3VLVideoProcessor(patch_size=16), chat_template=template
    )
    return save(folder, hf.Qwen3VLForConditionalGeneration, config, processor)


def build_gemma3(folder):
    """With a window of 12 tokens in one layer, so that the prefix is longer than it sees."""
    from transformers.models.gemma3.image_processing_pil_gemma3 import Gemma3ImageProcessorPil

    names = {
        "image_token": "<image_soft_token>",
        "boi_token": "<start_of_image>",
        "eoi_token": "<end_of_image>",
    }
    tokens = tokenizer(["<pad>", "<s>", "</s>", *names.values()], extra_special_tokens=names)
    text = text_config(
        tokens,
        sliding_window=12,
        layer_types=["sliding_attention", "full_attention"],
        query_pre_attn_scalar=16,
    )
    config = hf.Gemma3Config(
        text_config=text,
        vision_config=vision_config(image_size=56, patch_size=14),
        mm_tokens_per_image=4,
        image_token_index=tokens.image_token_id,
        boi_token_index=tokens.boi_token_id,
        eoi_token_index=tokens.eoi_token_id,
        tie_word_embeddings=False,
    )
    processor = hf.Gemma3Processor(
        Gemma3ImageProcessorPil(size={"height": 56, "width": 56}),
        tokens,
        image_seq_length=4,
        chat_template=chat_template("<start_of_image>"),
    )
    # Gemma multiplies embeddings by the root of their width.
    return save(folder, hf.Gemma3ForConditionalGeneration, config, processor, embedding=1 / 8)


def build_internvl(folder):
    from transformers.models.got_ocr2.image_processing_pil_got_ocr2 import GotOcr2ImageProcessorPil

    names = {
        "start_image_token": "<img>",
        "end_image_token": "</img>",
        "context_image_token": "<IMG_CONTEXT>",
        "video_token": "<video>",
    }
    tokens = tokenizer(["<pad>", "<s>", "</s>", *names.values()], extra_special_tokens=names)
    config = hf.InternVLConfig(
        text_config=text_config(tokens, model_type="qwen2"),
        vision_config=vision_config(image_size=[56, 56], patch_size=[14, 14]),
        image_token_id=tokens.context_image_token_id,
        image_seq_length=4,
        tie_word_embeddings=False,
    )
    processor = hf.InternVLProcessor(
        GotOcr2ImageProcessorPil(size={"height": 56, "width": 56}, max_patches=4),
        tokens,
        hf.InternVLVideoProcessor(size={"height": 56, "width": 56}),
        image_seq_length=4,
        chat_template=chat_template("<IMG_CONTEXT>"),
    )
    return save(folder, hf.InternVLForConditionalGeneration, config, processor)


def build_llava(folder):
    """Its text goes on behind the image without a control token between."""
    from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil

    tokens = tokenizer(["<pad>", "<s>", "</s>", "<image>"])
    config = hf.LlavaConfig(
        text_config=text_config(tokens, model_type="llama"),
        vision_config=vision_config(model_type="clip_vision_model", image_size=56, patch_size=14),
        image_token_index=tokens.convert_tokens_to_ids("<image>"),
        vision_feature_select_strategy="default",
        vision_feature_layer=-2,
    )
    processor = hf.LlavaProcessor(
        CLIPImageProcessorPil(size={"shortest_edge": 56}, crop_size={"height": 56, "width": 56}),
        tokens,
        patch_size=14,
        vision_feature_select_strategy="default",
        num_additional_image_tokens=1,
        chat_template=chat_template("<image>"),
    )
    return save(folder, hf.LlavaForConditionalGeneration, config, processor)


def build_paligemma(folder):
    """Without a chat template; its image and question see each other."""
    from transformers.models.siglip.image_processing_pil_siglip import SiglipImageProcessorPil

    tokens = tokenizer(["<pad>", "<s>", "</s>", "<image>"])
    images = SiglipImageProcessorPil(size={"height": 56, "width": 56})
    images.image_seq_length = 16
    processor = hf.PaliGemmaProcessor(images, tokens)
    config = hf.PaliGemmaConfig(
        text_config=text_config(tokens, model_type="gemma"),
        vision_config=vision_config(
            model_type="siglip_vision_model", image_size=56, patch_size=14, projection_dim=64
        ),
        image_token_index=processor.image_token_id,
        projection_dim=64,
        tie_word_embeddings=False,
    )
    return save(folder, hf.PaliGemmaForConditionalGeneration, config, processor, embedding=1 / 8)


BUILDERS = {
    "idefics3": build_idefics3,
    "gemma3": build_gemma3,
    "llava": build_llava,
    "paligemma": build_paligemma,
    "smolvlm": build_smolvlm,
    "qwen2_5_vl": build_qwen25,
    "qwen3_vl": build_qwen3,
    "internvl": build_internvl,
}

NEEDS = {
    "smolvlm": ("torchvision", "num2words"),
    "qwen2_5_vl": ("torchvision",),
    "qwen3_vl": ("torchvision",),
    "internvl": ("torchvision",),
}


def lacking(family):
    """Packages that the family needs and this machine lacks."""
    return [package for package in NEEDS.get(family, ()) if find_spec(package) is None]
