"""Paint the style pictures of texgs that are computed, and describe all: `python -m tools.style_pictures`.

Each is a function of the generator of its random numbers. It colours pixels by where they are, from 0 to 1
along both sides. To describe them, see `texgs.metrics.retrieval`, needs the weights of VGG-16.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from safetensors.torch import save_file
from scipy.ndimage import gaussian_filter, zoom
from scipy.spatial import cKDTree
from torch import Tensor
from torch.nn import functional as F

from texgs.metrics.retrieval import KNOWN, LAYERS, SCALES, Likeness, likeness
from texgs.metrics.retrieval import SIZE as SIDE
from texgs.models.pictures import PICTURES, picture
from texgs.models.vgg import Vgg

FOLDER = Path(__file__).parents[1] / "texgs" / "models" / "pictures"
SIZE, FINE = 512, 2  # pixels of a side, and how many times as many are painted and then averaged
N = SIZE * FINE
Y, X = np.mgrid[0:N, 0:N] / N
PLACES = np.stack([Y, X], axis=-1).reshape(-1, 2)
Random = np.random.Generator
PAINTED: dict[str, Callable[[Random], np.ndarray]] = {}


def painted(function: Callable[[Random], np.ndarray]) -> Callable[[Random], np.ndarray]:
    """Enter a picture under the name of its function."""
    PAINTED[function.__name__] = function
    return function


def colors(*names: str) -> np.ndarray:
    """Return colours [n, 3] from hexadecimal names."""
    return np.array([[int(name[i : i + 2], 16) / 255 for i in (0, 2, 4)] for name in names])


def ramp(values: np.ndarray, *names: str) -> np.ndarray:
    """Return the colours of values in [0, 1] on a ramp of colours; beyond, those of its ends."""
    listed = colors(*names)
    at = np.linspace(0, 1, len(listed))
    return np.stack([np.interp(values, at, channel) for channel in listed.T], axis=-1)


def flat(name: str) -> np.ndarray:
    """Return a picture of one colour."""
    return np.broadcast_to(colors(name)[0], (N, N, 3)).copy()


def mix(below: np.ndarray, above: np.ndarray | str, share: np.ndarray) -> np.ndarray:
    """Paint a picture or a colour over another one, with a share of [0, 1] in each pixel."""
    above = flat(above) if isinstance(above, str) else above
    return below + (above - below) * np.clip(share, 0, 1)[..., None]


def edge(value: np.ndarray, width: float) -> np.ndarray:
    """Return 1 where a value is positive and 0 where it is negative, with a soft edge."""
    return np.clip(value / width + 0.5, 0, 1)


def noise(random: Random, scale: int, octaves: int = 4) -> np.ndarray:
    """Return smooth noise of mean 0 and deviation 1, with so many bumps along a side."""
    total = np.zeros((N, N))
    for octave in range(octaves):
        count = scale * 2**octave
        grid = random.normal(size=(count + 3, count + 3))
        total += zoom(grid, N / count, order=3)[:N, :N] / 2**octave
    return (total - total.mean()) / total.std()


def cells(random: Random, count: int, jitter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return distances to the two nearest of points, the index of the first, and the points."""
    side = int(np.ceil(np.sqrt(count)))
    grid = np.stack(np.mgrid[-2 : side + 2, -2 : side + 2], axis=-1).reshape(-1, 2)
    points = (grid + 0.5 + jitter * random.uniform(-0.5, 0.5, grid.shape)) / side
    return (*nearest(points), points)


def nearest(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each pixel the distances to the two nearest points, and the index of the first."""
    distances, index = cKDTree(points).query(PLACES, k=2)
    first, second, which = (x.reshape(N, N) for x in (*distances.T, index[:, 0]))
    return first, second, which


def rim(*shares: np.ndarray) -> np.ndarray:
    """Return how far pixels are from the border of their tile, in tiles."""
    return np.minimum.reduce([np.minimum(x % 1, 1 - x % 1) for x in shares])


@painted
def hatching(random: Random) -> np.ndarray:
    """Pencil lines, crossed where it is dark."""
    tone, wobble, ink = noise(random, 3, 2), 0.004 * noise(random, 6, 2), np.zeros((N, N))
    for level, angle in ((1.0, 0.7), (0.2, -0.7), (-0.6, 1.5)):
        across = X * np.cos(angle) + Y * np.sin(angle) + wobble
        line = np.abs((across * 42) % 1 - 0.5)
        ink = np.maximum(ink, edge(0.16 - line, 0.12) * edge(level - tone, 0.3) * 0.85)
    return mix(ramp(0.5 + 0.05 * noise(random, 60, 2), "efe7d6", "fbf6ea"), "2c2c34", ink)


@painted
def mosaic(random: Random) -> np.ndarray:
    """Square tiles from the sea to the sun."""
    u, v = X * 22, Y * 22
    shade = noise(random, 3, 2)[:: N // 22, :: N // 22]
    row, column = np.floor(v).astype(int), np.floor(u).astype(int)
    tone = shade[row, column] + 0.6 * random.normal(size=(23, 23))[row, column]
    tile = ramp(0.5 + 0.25 * tone, "0e3b4c", "1b7a86", "58b7a0", "e9d8a0", "d77a3a", "8c2f2b")
    return mix(flat("cfc8ba"), tile, edge(rim(u, v) - 0.07, 0.05))


@painted
def bricks(random: Random) -> np.ndarray:
    """Make a wall."""
    v = Y * 16
    row = np.floor(v).astype(int)
    u = X * 7 + 0.5 * (row % 2)
    tone = random.normal(size=(20, 20))[row, np.floor(u).astype(int)]
    brick = ramp(0.5 + 0.18 * tone + 0.08 * noise(random, 40), "6d2416", "a8412a", "c9694a")
    mortar = ramp(0.5 + 0.1 * noise(random, 60), "b9b2a6", "d9d4c8")
    return mix(mortar, brick, edge(np.minimum(2.3 * rim(u), rim(v)) - 0.1, 0.06))


@painted
def scales(random: Random) -> np.ndarray:
    """Let scales of a fish overlap."""
    image = np.zeros((N, N, 3))
    for row in range(22, -2, -1):
        u, top = X * 12 + 0.5 * (row % 2), row / 20
        radius = np.hypot((u % 1) - 0.5, (Y - top) * 12)
        tone = ramp(radius / 0.62, "7fd6c2", "2f9f9a", "0f5560", "06262f")
        image = np.where(((radius < 0.62) & (top - 0.005 < Y))[..., None], tone, image)
    return image


@painted
def zebra(random: Random) -> np.ndarray:
    """Draw black stripes that fork."""
    stripe = np.sin(2 * np.pi * (X * 9 + 0.55 * noise(random, 3, 2) + 0.8 * Y))
    return mix(flat("f4efe6"), "15130f", edge(stripe + 0.25 * noise(random, 7, 2), 0.2))


@painted
def leopard(random: Random) -> np.ndarray:
    """Draw broken rings on fur."""
    far, _, _, _ = cells(random, 130, 0.9)
    far = far + 0.006 * noise(random, 16, 2)
    fur = ramp(0.5 + 0.2 * noise(random, 8), "d79a4a", "e9be7a", "f1d8a4")
    middle = mix(fur, "b06a2a", edge(0.024 - far, 0.01) * 0.8)
    ring = edge(0.0085 - np.abs(far - 0.026), 0.004) * edge(noise(random, 14, 1) + 0.9, 0.3)
    return mix(middle, "23150c", ring)


@painted
def planks(random: Random) -> np.ndarray:
    """Lay boards with their grain."""
    board = np.floor(X * 6).astype(int)
    shift = random.uniform(0, 9, 8)[board]
    grain = np.sin(2 * np.pi * (X * 26 + 0.9 * noise(random, 2, 2) + shift + 0.35 * np.sin(5 * Y + shift)))
    fibres = gaussian_filter(random.normal(size=(N, N)), (26, 0.7))
    tone = 0.5 + 0.2 * grain + 0.14 * fibres / fibres.std() + 0.12 * random.normal(size=8)[board]
    wood = ramp(tone, "4a2a12", "8a5527", "b98246", "d9ae74")
    return mix(flat("23140a"), wood, edge(rim(X * 6) - 0.025, 0.02))


@painted
def contours(random: Random) -> np.ndarray:
    """Draw a map of heights."""
    level = 4 * noise(random, 3, 3)
    slope = np.hypot(*np.gradient(level)) + 1e-6
    height = (np.floor(level) / 4 + 2) / 4
    band = ramp(height, "2a6f4e", "7fae5c", "dcd08a", "c98f52", "8a5a3c", "f3efe8")
    return mix(band, "4a3524", edge(2.2 - np.abs(level - np.round(level)) / slope, 1.5))


@painted
def crackle(random: Random) -> np.ndarray:
    """Let mud dry."""
    first, second, index, points = cells(random, 150, 1.0)
    tone = 0.5 + 0.16 * random.normal(size=len(points))[index] + 0.1 * noise(random, 24)
    mud = ramp(tone, "a98763", "c8a982", "ddc5a2")
    gap = second - first + 0.003 * noise(random, 30, 2)
    return mix(flat("241a12"), mud, edge(gap - 0.007, 0.006))


@painted
def honeycomb(random: Random) -> np.ndarray:
    """Draw cells of wax, some of them full."""
    side, height = 13, np.sqrt(3) / 2
    rows, columns = np.mgrid[-2 : 2 * side, -2 : side + 3]
    points = np.stack([rows * height, columns + 0.5 * (rows % 2)], axis=-1).reshape(-1, 2) / side
    first, second, index = nearest(points)
    tone = 1.1 - first * side * 1.7 + 0.12 * random.normal(size=len(points))[index]
    wax = ramp(1 - tone, "f7c948", "e09a17", "8f4f06", "4f2803")
    return mix(flat("ffe9a8"), wax, edge(second - first - 0.012, 0.006))


@painted
def swirls(random: Random) -> np.ndarray:
    """Let strokes follow eddies, by line integral convolution."""
    angle = 0.6 * noise(random, 2, 2)
    for y, x in random.uniform(0, 1, (9, 2)):
        radius = np.hypot(Y - y, X - x)
        turn = np.arctan2(Y - y, X - x) + np.pi / 2 + 9 * radius
        angle = angle + 1.3 * turn * np.exp(-((radius / 0.13) ** 2))
    grain = random.normal(size=(N, N))
    total, soft = grain.copy(), 6 * gaussian_filter(grain, 3)
    for way in (2, -2):
        rows, columns = Y * N, X * N
        for _ in range(22):
            at = angle[np.clip(rows.astype(int), 0, N - 1), np.clip(columns.astype(int), 0, N - 1)]
            rows, columns = rows + way * np.sin(at), columns + way * np.cos(at)
            total += soft[rows.astype(int) % N, columns.astype(int) % N]
    tone = 0.5 + 0.22 * total / total.std()
    return ramp(tone, "0a1440", "1d3f8f", "3f7fc2", "9cc9d8", "f3e6a0", "f0b429")


@painted
def splatter(random: Random) -> np.ndarray:
    """Throw paint: blots, and threads over them."""
    image, paints = flat("efe9dc"), colors("1c1c1c", "b3202a", "1f4e9c", "e3b21a", "1c1c1c", "2f7d4f")
    for blot in range(260):
        (y, x), radius = random.uniform(0, 1, 2), 0.004 + 0.02 * random.pareto(3)
        box = tuple(slice(int(N * max(c - 2 * radius, 0)), int(N * min(c + 2 * radius, 1))) for c in (y, x))
        down, right = Y[box] - y, X[box] - x
        turn = np.arctan2(down, right)
        wave = 1 + 0.25 * np.sin(5 * turn + blot) + 0.15 * np.sin(11 * turn + 2 * blot)
        image[box][np.hypot(down, right) < radius * wave] = paints[random.integers(6)]
    along = np.linspace(0, 1, 1500)[:, None]
    for _ in range(60):
        start, way, bend = random.uniform(-0.1, 1.1, 2), random.normal(0, 0.35, 2), random.normal(0, 0.12, 2)
        half, paint = max(int(N * random.uniform(0.0015, 0.005)), 1), paints[random.integers(6)]
        for row, column in (N * (start + along * way + np.sin(6 * along) * bend)).astype(int):
            if 0 <= row < N and 0 <= column < N:
                image[max(row - half, 0) : row + half, max(column - half, 0) : column + half] = paint
    return image


@painted
def knit(random: Random) -> np.ndarray:
    """Knit stripes."""
    side = np.abs(X * 15 % 1 - 0.5)
    at = Y * 20 + 1.1 * side
    body = np.sin(np.pi * (at % 1)) * np.clip(1 - (np.abs(side - 0.25) / 0.25) ** 2, 0, 1)
    wool = colors("a4243b", "a4243b", "f2ead8", "273e6b", "273e6b", "f2ead8")[np.floor(at).astype(int) % 6]
    return wool * (0.35 + 0.75 * np.sqrt(body) + 0.08 * noise(random, 120, 1))[..., None]


@painted
def halftone(random: Random) -> np.ndarray:
    """Print dots of three inks over each other."""
    tone, image = np.clip(0.5 + 0.28 * noise(random, 2, 2), 0, 1), flat("fbf5e6")
    for name, angle, shift in (("00a0c8", 0.26, 0.0), ("e2137b", 1.3, 0.35), ("f7d417", 0.0, -0.3)):
        a, b = X * np.cos(angle) + Y * np.sin(angle), Y * np.cos(angle) - X * np.sin(angle)
        radius = np.hypot((a * 34) % 1 - 0.5, (b * 34) % 1 - 0.5)
        size = 0.62 * np.sqrt(np.clip(tone + shift * noise(random, 2, 1), 0.02, 1))
        image *= 1 - edge(size - radius, 0.06)[..., None] * (1 - colors(name)[0])
    return image


@painted
def labyrinth(random: Random) -> np.ndarray:
    """Grow the walls of Turing's patterns: near excites, far inhibits."""
    field = random.normal(size=(N // 4, N // 4))
    for _ in range(14):
        field = gaussian_filter(field, 2.0, mode="wrap") - gaussian_filter(field, 3.4, mode="wrap")
        field = np.tanh(3 * field / field.std())
    return mix(flat("e86a33"), "1f2a5a", edge(zoom(field, 4, order=3), 0.5))


@painted
def tartan(random: Random) -> np.ndarray:
    """Weave bands of two threads in twill."""

    def threads(at: np.ndarray) -> np.ndarray:
        at = (at * 3) % 1
        wide, narrow = (at > 0.1) & (at < 0.42), ((at > 0.55) & (at < 0.62)) | ((at > 0.7) & (at < 0.74))
        return ramp(0.55 * wide + 0.9 * narrow, "8a1525", "123a5a", "f2d16b")

    is_warp = (np.floor(X * 128) + np.floor(Y * 128)) % 4 < 2
    return np.where(is_warp[..., None], threads(X), threads(Y))


@painted
def feathers(random: Random) -> np.ndarray:
    """Let feathers of a peacock overlap."""
    image, step = flat("0d2b3a"), 0.085
    for number in range(13, -3, -1):
        for column in np.arange(-0.1, 1.2, 2 * step):
            v = (Y - step * number) / 0.24
            u = (X - column - step * (number % 2)) / step
            inside = (v > 0) & (v < 1) & (np.abs(u) < np.sin(np.pi * np.clip(v, 0, 1)) ** 0.7)
            barb = 0.5 + 0.5 * np.sin(55 * (v - 0.6 * np.abs(u)))
            tone = ramp(0.25 + 0.5 * v + 0.25 * barb, "0b3d2e", "1f7a4d", "49b26b", "b5d56a")
            eye = np.hypot((v - 0.7) / 0.2, u / 0.55)
            tone = np.where((eye < 1)[..., None], ramp(eye, "101a5c", "1b6fb5", "c9a227"), tone)
            tone = mix(tone, "f2ecd2", edge(0.05 - np.abs(u), 0.05))
            image = np.where(inside[..., None], tone, image)
    return image


@painted
def facets(random: Random) -> np.ndarray:
    """Cut an amethyst."""
    _, _, index, points = cells(random, 90, 1.0)
    tilt, middle = random.uniform(-1, 1, (len(points), 2))[index], points[index]
    shade = 7 * (tilt * (np.stack([Y, X], axis=-1) - middle)).sum(axis=-1)
    tone = 0.5 + 0.22 * random.normal(size=len(points))[index] + shade
    return ramp(tone, "2b1055", "6a2fa0", "b86adf", "f0c6f5", "ffffff")


@torch.no_grad()
def picture_likeness(image: Tensor, vgg: Vgg) -> Likeness:
    """Describe a picture [3, h, w] in [0, 1] at each of `SCALES`, [S] of them."""
    height, width = image.shape[1:]
    scaled = []
    for scale in SCALES:
        factor = scale * SIDE / max(height, width)
        size = [max(16, round(factor * side)) for side in (height, width)]
        small = F.interpolate(image[None], size, mode="bicubic", antialias=True)[0].clamp(0, 1)
        scaled.append(likeness(small, torch.ones(size, dtype=torch.bool, device=image.device), vgg))
    return Likeness.stacked(scaled)


def write_known(vgg: Vgg) -> Path:
    """Describe all pictures of texgs in the file that the metric `retrieval` reads; return the file."""
    described = Likeness.stacked(picture_likeness(picture(name), vgg) for name in PICTURES)
    file = Path(str(KNOWN))
    save_file({name: x.half().contiguous() for name, x in vars(described).items()}, file)
    return file


def main() -> None:
    """Write all pictures, and what views are compared with."""
    for seed, (name, function) in enumerate(PAINTED.items()):
        fine = np.clip(function(np.random.default_rng(seed)), 0, 1)
        image = fine.reshape(SIZE, FINE, SIZE, FINE, 3).mean(axis=(1, 3))
        file = FOLDER / f"{name}.webp"
        Image.fromarray((255 * image + 0.5).astype(np.uint8)).save(file, quality=90, method=6)
        print(file)
    print(write_known(Vgg.load(layers=LAYERS)))


if __name__ == "__main__":
    main()
