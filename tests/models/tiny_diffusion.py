"""An InstructPix2Pix of random weights, small enough for tests, in the files of the real one."""

import torch

from tests.models.clips import save_tokenizer

WORDS = ["make", "it", "gold", "light", "shadow", "a", "b"]


def save_tiny(folder, *, channels=8, seed=0, prediction="epsilon"):
    """Write unet, vae, text_encoder, tokenizer and scheduler; return the folder."""
    from diffusers import AutoencoderKL, DDIMScheduler, UNet2DConditionModel
    from transformers import CLIPTextConfig, CLIPTextModel

    torch.manual_seed(seed)
    unet = {"in_channels": channels, "out_channels": 4, "block_out_channels": (32, 64), "layers_per_block": 1}
    unet |= {"down_block_types": ("CrossAttnDownBlock2D", "DownBlock2D"), "cross_attention_dim": 16}
    unet |= {"up_block_types": ("UpBlock2D", "CrossAttnUpBlock2D"), "attention_head_dim": 4}
    vae = {"block_out_channels": (8, 8, 8, 8), "norm_num_groups": 4, "latent_channels": 4}
    vae |= {"down_block_types": ("DownEncoderBlock2D",) * 4, "up_block_types": ("UpDecoderBlock2D",) * 4}
    words = {"vocab_size": 600, "hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1}
    words |= {"num_attention_heads": 2, "max_position_embeddings": 12}
    UNet2DConditionModel(**unet, norm_num_groups=8).save_pretrained(folder / "unet")
    AutoencoderKL(**vae).save_pretrained(folder / "vae")
    CLIPTextModel(CLIPTextConfig(**words)).save_pretrained(folder / "text_encoder")
    noise = {"beta_start": 0.00085, "beta_end": 0.012, "beta_schedule": "scaled_linear"}
    DDIMScheduler(**noise, prediction_type=prediction).save_pretrained(folder / "scheduler")
    save_tokenizer(folder / "tokenizer", WORDS, 12)
    return folder
