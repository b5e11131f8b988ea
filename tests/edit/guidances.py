"""Guidances without networks or filters."""

import torch


class Identity:
    """Changes nothing."""

    name = "identity"

    def __init__(self, lit=True):
        self.lit = lit

    def __call__(self, views, instruction, generator):
        return views.images.clone()


class Tint(Identity):
    """Every view in one colour, where it shows anything; keeps the views it was given.

    With a sigma, every view of every call goes half way to a colour that is off by chance.
    """

    name = "tint"

    def __init__(self, color, lit=False, sigma=0.0):
        super().__init__(lit)
        self.color, self.sigma, self.seen = torch.tensor(color), sigma, []

    def __call__(self, views, instruction, generator):
        self.seen.append(views)
        alpha = views.alphas[..., None]
        if not self.sigma:
            return self.color * alpha + 1 - alpha
        color = self.color + self.sigma * torch.randn(len(views), 1, 1, 3, generator=generator)
        return 0.5 * views.images + 0.5 * (color.clamp(0, 1) * alpha + 1 - alpha)


class Returns(Identity):
    """Whatever it was given."""

    name = "broken"

    def __init__(self, images):
        super().__init__()
        self.found = images

    def __call__(self, views, instruction, generator):
        return self.found(views) if callable(self.found) else self.found
