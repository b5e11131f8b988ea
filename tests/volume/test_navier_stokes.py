from itertools import pairwise
from math import exp, pi

import pytest
import torch

from texgs.volume.generate import random_flow
from texgs.volume.navier_stokes import (
    curl,
    energy,
    evolve,
    project,
    sample,
    to_field,
    to_spectrum,
)

N = 16


pytestmark = pytest.mark.usefixtures("one_thread")


def lattice(n=N):
    axis = torch.arange(n, dtype=torch.float64) * 2 * pi / n
    z, y, x = torch.meshgrid(axis, axis, axis, indexing="ij")
    return x, y, z


def flow(n=32, seed=0):
    return random_flow(n, 1.5, 2.5, seed).to(torch.complex128)


def largest(tensor):
    return float(tensor.abs().max())


def test_samples_are_exact_anywhere():
    x, y, z = lattice()
    wave = lambda x, y, z: torch.sin(3 * x - 2 * y + z) + torch.cos(2 * z + x) + 0.25  # noqa: E731
    places = [torch.tensor([0.1, 2.0, 6.0]), torch.tensor([1.3, 5.1]), torch.tensor([0.7, 3.3, 4.4, 5.5])]
    pz, py, px = torch.meshgrid(*[place.double() for place in places], indexing="ij")
    values = sample(to_spectrum(wave(x, y, z)), *[place.double() for place in places])
    torch.testing.assert_close(values, wave(px, py, pz), atol=1e-13, rtol=0)


def test_curl_and_projection_of_known_fields():
    x, y, z = lattice()
    gradient = torch.stack([torch.cos(x) * torch.cos(2 * y), -2 * torch.sin(x) * torch.sin(2 * y), 0 * z])
    whirl = torch.stack([torch.sin(3 * z), torch.cos(x), torch.sin(y)])
    vorticity = torch.stack([torch.cos(y), 3 * torch.cos(3 * z), -torch.sin(x)])
    torch.testing.assert_close(to_field(curl(to_spectrum(whirl + gradient))), vorticity)
    torch.testing.assert_close(to_field(project(to_spectrum(whirl + gradient))), whirl)


def test_a_taylor_green_vortex_is_carried_by_a_wind():
    # In two dimensions it decays in place; seen from a moving frame it travels, which only advection can do.
    x, y, z = lattice()
    vortex = lambda x, y: torch.stack([torch.cos(x) * torch.sin(y), -torch.sin(x) * torch.cos(y), 0 * z])  # noqa: E731
    wind = torch.tensor([0.7, -0.3, 0.2], dtype=torch.float64)[:, None, None, None]
    viscosity, time = 0.02, 2.0
    (later,) = evolve(to_spectrum(vortex(x, y) + wind), viscosity, [time])
    expected = vortex(x - 0.7 * time, y + 0.3 * time) * exp(-2 * viscosity * time) + wind
    torch.testing.assert_close(to_field(later), expected, atol=3e-5, rtol=0)  # error of time steps


def test_time_steps_are_of_fourth_order(monkeypatch):
    (reference,) = _with_courant(monkeypatch, 0.05)
    errors = [largest(v - reference) for (v,) in (_with_courant(monkeypatch, c) for c in (0.8, 0.4))]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.35)


def _with_courant(monkeypatch, courant):
    monkeypatch.setattr("texgs.volume.navier_stokes.COURANT", courant)
    return list(evolve(flow(16), 0.02, [0.4]))


def test_energy_falls_by_what_viscosity_takes():
    # dE/dt = -2 viscosity * enstrophy, with enstrophy the mean of half the squared vorticity.
    viscosity, times = 0.02, [0.0, 0.1, 0.2, 0.3, 0.4]
    states = list(evolve(flow(), viscosity, times))
    energies = [energy(state) for state in states]
    assert all(later < earlier for earlier, later in pairwise(energies))
    rates = [-2 * viscosity * energy(curl(state)) for state in states]
    # Simpson's rule over the five times.
    lost = 0.1 / 3 * (rates[0] + 4 * rates[1] + 2 * rates[2] + 4 * rates[3] + rates[4])
    assert energies[-1] - energies[0] == pytest.approx(lost, rel=2e-3)
    assert rates[-1] < 1.2 * rates[0]  # vortices stretched, so that energy falls faster
