import pytest
import torch
from torch.testing import assert_close

from tests.fields.gaussians.samples import sample
from texgs.core.camera import orbit
from texgs.raster import Options
from texgs.raster.reference.render import rasterize

CAMERA = orbit(30, 20, 3, 40, 48, 40)


def directional(camera, means, sh):
    """Colours of harmonics of degree 0 and 1 as 3DGS has them, in float64."""
    away = torch.nn.functional.normalize(means.double() - camera.position.double(), dim=1)
    x, y, z = away[..., None].unbind(1)
    sh = sh.double()
    linear = -y * sh[:, 1] + z * sh[:, 2] - x * sh[:, 3]
    return (0.5 + 0.28209479177387814 * sh[:, 0] + 0.4886025119029199 * linear).clamp_min(0)


@pytest.mark.parametrize("antialiased", [False, True])
def test_a_view_is_that_of_the_float64_reference(antialiased):
    model = sample(30, degree=1, antialiased=antialiased)
    p = {name: x.double() for name, x in model.parameters.items()}
    expected = rasterize(
        p["means"],
        p["quats"],
        p["scales"].exp(),
        p["opacities"].sigmoid(),
        CAMERA.viewmat.double(),
        CAMERA.K.double(),
        CAMERA.width,
        CAMERA.height,
        features=directional(CAMERA, p["means"], p["sh"]),
        background=torch.ones(3).double(),
        outputs=("depth",),
        options=Options(antialiased=antialiased),
    )
    rendered = model.render(CAMERA, outputs=("depth",))
    # Rounding of float32; a fragment whose alpha is at the threshold of 1/255 may be in one of them only.
    assert_close(rendered.color.double(), expected.color, atol=5e-3, rtol=0)
    assert float((rendered.color - expected.color).abs().mean()) < 1e-5
    assert float((rendered.depth - expected.depth).abs().mean()) < 1e-3
