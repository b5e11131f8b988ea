"""Pseudo-spectral solution of the incompressible Navier-Stokes equations in a periodic box of side 2 pi.

Real fields [..., n, n, n] with axes z, y, x have spectra [..., n, n, n // 2 + 1]; n is even. Vectors have
their components x, y, z in front.
"""

from collections.abc import Iterable, Iterator
from math import ceil, pi

import torch
from torch import Tensor

AXES = (-3, -2, -1)  # z, y, x
COURANT = 1.2  # cells that the fastest fluid crosses per time step; Runge-Kutta is stable up to 1.35


def to_spectrum(field: Tensor) -> Tensor:
    """Return Fourier coefficients of a field, scaled so that they do not depend on the resolution."""
    return torch.fft.rfftn(field, dim=AXES, norm="forward")


def to_field(spectrum: Tensor) -> Tensor:
    """Return the field of a spectrum."""
    n = spectrum.shape[-2]
    return torch.fft.irfftn(spectrum, s=(n, n, n), dim=AXES, norm="forward")


def sample(spectrum: Tensor, z: Tensor, y: Tensor, x: Tensor) -> Tensor:
    """Return values [..., len(z), len(y), len(x)] of the field at any places, exactly; the box is 0 to 2 pi.

    The highest wavenumber n / 2 has to be empty, as no real field has a unique one there.
    """
    full, half = _frequencies(spectrum)
    # Trigonometric sums along one axis after the other; along x in real numbers, where k stands for -k too.
    spectrum = torch.einsum("...zyx,pz->...pyx", spectrum, _waves(z, full))
    spectrum = torch.einsum("...zyx,py->...zpx", spectrum, _waves(y, full))
    pairs = torch.where(half > 0, 2, 1) * _waves(-x, half)
    return torch.einsum("...xc,pxc->...p", torch.view_as_real(spectrum), torch.view_as_real(pairs))


def wavevectors(spectrum: Tensor) -> Tensor:
    """Return wavevectors [3, n, n, n // 2 + 1] of the coefficients of a spectrum, components x, y, z."""
    full, half = _frequencies(spectrum)
    z, y, x = torch.meshgrid(full, full, half, indexing="ij")
    return torch.stack([x, y, z])


def curl(vector: Tensor) -> Tensor:
    """Return the spectrum of the curl of a vector field; of a velocity, the vorticity."""
    return 1j * _cross(wavevectors(vector), vector)


def project(vector: Tensor) -> Tensor:
    """Return the divergence-free part of a vector field."""
    k = wavevectors(vector)
    return vector - k * ((k * vector).sum(0) / (k * k).sum(0).clamp_min(1))


def energy(vector: Tensor) -> float:
    """Return the mean of |v|^2 / 2 over the box (Parseval's theorem)."""
    weight = torch.full(vector.shape[-1:], 2.0, dtype=torch.float64, device=vector.device)
    weight[0] = weight[-1] = 1  # all other coefficients of a real field stand for k and -k
    return 0.5 * float((vector.abs().double().square() * weight).sum())


def evolve(velocity: Tensor, viscosity: float, times: Iterable[float]) -> Iterator[Tensor]:
    """Follow a flow [3, ...] that no force drives, and yield its spectrum at ascending times, from 0 on.

    dv/dt = v x curl(v) - grad(p + v^2 / 2) + viscosity laplace(v) with div v = 0.
    Products are formed on the grid and cut at 2/3 of the highest wavenumber, which keeps aliases out
    (Orszag 1971). Runge-Kutta of fourth order; the viscous term is integrated exactly.
    """
    k = wavevectors(velocity)
    n, damping = velocity.shape[-2], -viscosity * (k * k).sum(0)
    dealias = (k.abs() < n / 3).all(0)
    velocity, now = velocity * dealias, 0.0
    for time in times:
        while now < time:
            fastest = float(to_field(velocity).abs().sum(0).max())
            n_steps = max(1, ceil((time - now) * fastest * n / (2 * pi * COURANT)))
            step = (time - now) / n_steps
            velocity = _step(velocity, step, torch.exp(0.5 * step * damping), dealias)
            now = time if n_steps == 1 else now + step
        yield velocity


def _step(v: Tensor, step: float, decay: Tensor, dealias: Tensor) -> Tensor:
    """Do one step of Runge-Kutta; `decay` is what viscosity leaves after half of it."""
    a = _advection(v, dealias)
    b = _advection(decay * (v + 0.5 * step * a), dealias)
    c = _advection(decay * v + 0.5 * step * b, dealias)
    d = _advection(decay * (decay * v + step * c), dealias)
    return decay * (decay * (v + step / 6 * a) + step / 3 * (b + c)) + step / 6 * d


def _advection(v: Tensor, dealias: Tensor) -> Tensor:
    """Return the divergence-free part of v x curl(v): the projection takes the gradients away."""
    product = _cross(to_field(v), to_field(curl(v)))
    return project(to_spectrum(product)) * dealias


def _cross(a: Tensor, b: Tensor) -> Tensor:
    """Return the cross product along the first axis, several times as fast as torch's in this layout."""
    return torch.stack([a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)])


def _waves(places: Tensor, k: Tensor) -> Tensor:
    """Return exp(i k place), [places, k]."""
    phase = places.to(k)[:, None] * k
    return torch.polar(torch.ones_like(phase), phase)


def _frequencies(spectrum: Tensor) -> tuple[Tensor, Tensor]:
    """Return wavenumbers along z and y [n], and along x [n // 2 + 1]."""
    n, real, device = spectrum.shape[-2], spectrum.real.dtype, spectrum.device
    full = torch.fft.fftfreq(n, 1 / n, dtype=real, device=device)
    return full, torch.fft.rfftfreq(n, 1 / n, dtype=real, device=device)
