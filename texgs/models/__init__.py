"""Pretrained models behind thin adapters."""
