"""Filters that answer a documented vocabulary of instructions, for machines without a diffusion model."""

from texgs.models.filters.guidance import ProceduralFilters
from texgs.models.filters.vocabulary import vocabulary

__all__ = ["ProceduralFilters", "vocabulary"]
