"""The definition of what planes leave of rays, in plain torch: any floating-point type."""

import torch
from torch import Tensor
from torch.nn.functional import pad


def cut_range(normals: Tensor, offsets: Tensor, origin: Tensor, rays: Tensor) -> tuple[Tensor, Tensor]:
    """Return `depth_range` and `face` of rays [H, W, 3] with camera z 1 from a point; see `raster.cuts`."""
    slope = rays @ normals.mT  # [H, W, P]: how fast a ray leaves the kept side
    place = (offsets - normals @ origin) / slope.abs()
    enters = torch.where(slope < 0, -place, 0).clamp_min(0)
    near, face = pad(enters, (1, 0)).max(dim=-1)
    far = torch.where(slope >= 0, place, torch.inf).nan_to_num(torch.inf, torch.inf, -torch.inf)
    far = pad(far, (1, 0), value=torch.inf).amin(-1)
    return torch.stack([near, far]), torch.where(near < far, face - 1, -1).int()
