"""An InstructPix2Pix of random weights, small enough for tests, in the files of the real one."""

import torch

from tests.models.clips import save_tokenizer

WORDS = ["make", "it", "gold", "light", "shadow", "a", "b"]


def save_tiny(folder, *, channels=8, seed=0, prediction="epsilon"):
    """Write unet, vae, text_encoder, tokenizer and scheduler; return the folder."""
    from diffusers import AutoencoderKL, DDIMScheduler, UNet2DConditionModel
    from transformers import CLIPTextConfig, CLIPTextModel

    torch.manual_seed(seed)
    unet = UNet2DConditionModel(
        in_channels=channels,
        out_channels=4,
        block_out_channels=(32, 64),
        layers_per_block=1,
        down_block_types=("CrossAttnDownBlock2D", "DownBlock2D"),
        up_block_types=("UpBlock2D", "CrossAttnUpBlock2D"),
        cross_attention_dim=16,
        attention_head_dim=4,
        norm_num_groups=8,
    )
    vae = AutoencoderKL(
        block_out_channels=(8, 8, 8, 8),
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        norm_num_groups=4,
        latent_channels=4,
    )
    words = {"vocab_size": 600, "hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1}
    words |= {"num_attention_heads": 2, "max_position_embeddings": 12}
    text = CLIPTextModel(CLIPTextConfig(**words))
    for name, part in (("unet", unet), ("vae", vae), ("text_encoder", text)):
        part.save_pretrained(folder / name)
    DDIMScheduler(
        beta_start=0.00085, beta_end=0.012, beta_schedule="scaled_linear", prediction_type=prediction
    ).save_pretrained(folder / "scheduler")
    save_tokenizer(folder / "tokenizer", WORDS, 12)
    return folder
