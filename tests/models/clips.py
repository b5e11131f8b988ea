"""A random CLIP in the format of transformers, small enough for tests."""

import json

import pytest
import torch

WORDS = ("a", "beetle", "made", "of", "gold", "stone", "drawing", "the", "engine")


def write_clip(folder, size=32):
    """Write config, weights and tokenizer of a tiny CLIP with images of size x size; return the folder."""
    transformers = pytest.importorskip("transformers")
    torch.manual_seed(0)
    start, end = save_tokenizer(folder, WORDS, 16)
    both = {"hidden_size": 32, "intermediate_size": 37, "num_hidden_layers": 2, "num_attention_heads": 4}
    text = both | {"vocab_size": end + 1, "max_position_embeddings": 16}
    text |= {"bos_token_id": start, "eos_token_id": end, "pad_token_id": end}
    vision = both | {"image_size": size, "patch_size": 8}
    config = transformers.CLIPConfig(text_config=text, vision_config=vision, projection_dim=24)
    transformers.CLIPModel(config).save_pretrained(folder)
    return folder


def save_tokenizer(folder, words, length):
    """Write a tokenizer of byte pairs for a few words and at most so many tokens; return the last two ids."""
    folder.mkdir(parents=True, exist_ok=True)
    letters = [chr(code) for code in range(ord("!"), ord("~") + 1)]
    merges, tokens = [], []
    for word in words:  # one merge after the other, from the left
        parts = [*word[:-1], f"{word[-1]}</w>"]
        while len(parts) > 1:
            if (pair := f"{parts[0]} {parts[1]}") not in merges:
                merges.append(pair)
                tokens.append(parts[0] + parts[1])
            parts = [parts[0] + parts[1], *parts[2:]]
    start, end = "<|startoftext|>", "<|endoftext|>"
    names = dict.fromkeys([*letters, *(f"{x}</w>" for x in letters), *tokens, start, end])
    vocabulary = {token: place for place, token in enumerate(names)}
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("\n".join(["#version: 0.2", *merges]) + "\n")
    settings = {"tokenizer_class": "CLIPTokenizer", "model_max_length": length, "bos_token": start}
    settings |= dict.fromkeys(("eos_token", "unk_token", "pad_token"), end)
    (folder / "tokenizer_config.json").write_text(json.dumps(settings))
    return vocabulary[start], vocabulary[end]
