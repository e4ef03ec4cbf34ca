"""What transformers itself says with a chat model, one question at a time: the oracle for ours."""

import transformers

from vqa_state.models.chat.prefix_cache import N_TOKENS


def plain(folder, images, questions, template="{question} Answer yes or no.", **more):
    """What transformers says to one question at a time: (tokens, first-step logits) by pair."""
    processor = transformers.AutoProcessor.from_pretrained(folder)
    # With Pillow, as ours: where torchvision is installed, it would resize otherwise.
    processor.image_processor = transformers.AutoImageProcessor.from_pretrained(
        folder, backend="pil"
    )
    model = transformers.AutoModelForImageTextToText.from_pretrained(folder, **more)
    said = {}
    for i, image in enumerate(images):
        for q, question in enumerate(questions):
            text = template.replace("{question}", question)
            if processor.chat_template:
                content = [{"type": "image", "image": image}, {"type": "text", "text": text}]
                inputs = processor.apply_chat_template(
                    [{"role": "user", "content": content}],
                    add_generation_prompt=True,
                    tokenize=True,
                    return_dict=True,
                    return_tensors="pt",
                )
            else:
                inputs = processor(text="<image>" + text, images=image, return_tensors="pt")
                inputs.pop("labels", None)
            made = model.generate(
                **inputs,
                do_sample=False,
                max_new_tokens=N_TOKENS,
                return_dict_in_generate=True,
                output_logits=True,
            )
            tokens = made.sequences[0, inputs["input_ids"].shape[1] :].tolist()
            if tokens[-1] == model.generation_config.eos_token_id:
                tokens.pop()
            said[i, q] = (tuple(tokens), made.logits[0][0])
    return said
