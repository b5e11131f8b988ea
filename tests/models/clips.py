"""A random CLIP in the format of transformers, small enough for tests."""

import json

import pytest
import torch

WORDS = ("a", "beetle", "made", "of", "gold", "stone", "drawing", "the", "engine")


def write_clip(folder, size=32):
    """Write config, weights and tokenizer of a tiny CLIP with images of size x size; return the folder."""
    transformers = pytest.importorskip("transformers")
    torch.manual_seed(0)
    text = {"hidden_size": 32, "intermediate_size": 37, "num_hidden_layers": 2, "num_attention_heads": 4}
    tokens = ["<|startoftext|>", "<|endoftext|>"]
    letters = sorted(set("".join(WORDS)))
    vocabulary = [*letters, *(f"{letter}</w>" for letter in letters)]
    merges = []
    for word in WORDS:  # one merge after the other, from the left
        parts = [*word[:-1], f"{word[-1]}</w>"]
        while len(parts) > 1:
            if (pair := f"{parts[0]} {parts[1]}") not in merges:
                merges.append(pair)
            parts = [parts[0] + parts[1], *parts[2:]]
            if parts[0] not in vocabulary:
                vocabulary.append(parts[0])
    names = {name: index for index, name in enumerate([*vocabulary, *tokens])}
    text |= {"vocab_size": len(names), "max_position_embeddings": 16}
    text |= {
        "bos_token_id": names[tokens[0]],
        "eos_token_id": names[tokens[1]],
        "pad_token_id": names[tokens[1]],
    }
    vision = {"hidden_size": 32, "intermediate_size": 37, "num_hidden_layers": 2, "num_attention_heads": 4}
    vision |= {"image_size": size, "patch_size": 8}
    config = transformers.CLIPConfig(text_config=text, vision_config=vision, projection_dim=24)
    transformers.CLIPModel(config).save_pretrained(folder)
    (folder / "vocab.json").write_text(json.dumps(names))
    (folder / "merges.txt").write_text("#version: 0.2\n" + "\n".join(merges) + "\n")
    plain = {"tokenizer_class": "CLIPTokenizer", "model_max_length": 16, "bos_token": tokens[0]}
    plain |= {"eos_token": tokens[1], "unk_token": tokens[1], "pad_token": tokens[1]}
    (folder / "tokenizer_config.json").write_text(json.dumps(plain))
    return folder
