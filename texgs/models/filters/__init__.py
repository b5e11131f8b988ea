"""Filters that answer a documented vocabulary of instructions, for machines without a diffusion model."""
