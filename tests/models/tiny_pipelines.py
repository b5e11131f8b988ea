"""Pipelines of diffusers that edit images, of random weights, in the files of the real ones."""

import json

import torch

from tests.models.clips import save_tokenizer
from tests.models.tiny_diffusion import WORDS

VAE = {"block_out_channels": (8, 8, 8, 8), "norm_num_groups": 4}
VAE |= {"down_block_types": ("DownEncoderBlock2D",) * 4, "up_block_types": ("UpDecoderBlock2D",) * 4}
QWEN = ("<|endoftext|>", "<|im_start|>", "<|im_end|>")
CHAT = "{% for m in messages %}<|im_start|>{{ m['content'] }}<|im_end|>{% endfor %}"


def save_sdxl(folder, kind="StableDiffusionXLInstructPix2PixPipeline"):
    """Write Stable Diffusion XL as InstructPix2Pix, or as another kind of it; return the folder."""
    import diffusers
    from transformers import CLIPTextConfig, CLIPTextModel, CLIPTextModelWithProjection, CLIPTokenizer

    torch.manual_seed(0)
    words = {"vocab_size": 600, "hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 2}
    words |= {"num_attention_heads": 2, "max_position_embeddings": 12, "projection_dim": 16}
    unet = {"in_channels": 8 if "Instruct" in kind else 4, "block_out_channels": (16, 32)}
    unet |= {"layers_per_block": 1, "down_block_types": ("DownBlock2D", "CrossAttnDownBlock2D")}
    unet |= {"up_block_types": ("CrossAttnUpBlock2D", "UpBlock2D"), "attention_head_dim": (2, 4)}
    unet |= {"use_linear_projection": True, "cross_attention_dim": 32, "norm_num_groups": 8}
    unet |= {"addition_embed_type": "text_time", "addition_time_embed_dim": 8}
    unet |= {"projection_class_embeddings_input_dim": 6 * 8 + 16, "sample_size": 8}
    save_tokenizer(folder / "words", WORDS, 12)
    tokenizer = CLIPTokenizer.from_pretrained(folder / "words")
    getattr(diffusers, kind)(
        vae=diffusers.AutoencoderKL(**VAE, latent_channels=4),
        text_encoder=CLIPTextModel(CLIPTextConfig(**words)),
        text_encoder_2=CLIPTextModelWithProjection(CLIPTextConfig(**words)),
        tokenizer=tokenizer,
        tokenizer_2=tokenizer,
        unet=diffusers.UNet2DConditionModel(**unet),
        scheduler=diffusers.EulerDiscreteScheduler(),
    ).save_pretrained(folder)
    return folder


def save_klein(folder):
    """Write FLUX.2-klein, with its weights in several files; return the folder."""
    import diffusers
    from transformers import Qwen3Config, Qwen3ForCausalLM

    torch.manual_seed(0)
    words = {"hidden_size": 8, "intermediate_size": 8, "num_hidden_layers": 28, "num_attention_heads": 2}
    words |= {"num_key_value_heads": 2, "head_dim": 4, "vocab_size": 600}
    transformer = {"patch_size": 1, "in_channels": 16, "num_layers": 1, "num_single_layers": 1}
    transformer |= {"attention_head_dim": 16, "num_attention_heads": 2, "joint_attention_dim": 24}
    transformer |= {"axes_dims_rope": (4, 4, 4, 4), "timestep_guidance_channels": 8, "guidance_embeds": False}
    diffusers.Flux2KleinPipeline(
        scheduler=diffusers.FlowMatchEulerDiscreteScheduler(),
        vae=diffusers.AutoencoderKLFlux2(**VAE, latent_channels=4, layers_per_block=1),
        text_encoder=Qwen3ForCausalLM(Qwen3Config(**words)),
        tokenizer=qwen_tokenizer(folder / "words"),
        transformer=diffusers.Flux2Transformer2DModel(**transformer),
        is_distilled=True,
    ).save_pretrained(folder, max_shard_size="20KB")
    return folder


def qwen_tokenizer(folder):
    """A tokenizer of bytes with the special tokens and a template of a chat."""
    from tokenizers.pre_tokenizers import ByteLevel
    from transformers import Qwen2Tokenizer

    folder.mkdir(parents=True)
    vocabulary = {letter: place for place, letter in enumerate(sorted(ByteLevel.alphabet()))}
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    settings = {"tokenizer_class": "Qwen2Tokenizer", "pad_token": QWEN[0], "chat_template": CHAT}
    settings["additional_special_tokens"] = QWEN[1:]
    (folder / "tokenizer_config.json").write_text(json.dumps(settings))
    return Qwen2Tokenizer.from_pretrained(folder)
