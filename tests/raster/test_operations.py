"""Differentiable functions beside the rasterizer against definitions, and these by finite differences."""

import pytest
import torch

from tests.raster.operations import ON_CPU, OPERATIONS, evaluate, of_operation
from tests.raster.requirements import require_same_bits
from tests.refusals import refused
from texgs.core.errors import ArgumentError, DeviceError, ShapeError

ALL = OPERATIONS | ON_CPU


def cases(operations):
    """Return all names with all sizes."""
    pairs = [(name, size) for name, operation in operations.items() for size in operation.sizes]
    return pytest.mark.parametrize(("name", "size"), pairs, ids=str)


def check(operation, size, device):
    """Compare values and gradients with those of the definition in double precision."""
    exact = {name: x.double() for name, x in operation.inputs(*size).items()}
    values, gradients = evaluate(operation.definition, exact, operation.leaves)
    result = of_operation(operation, size, device)
    tolerances = [operation.tolerances[0]] * len(values) + [operation.tolerances[1]] * len(gradients)
    for one, other, tolerance in zip(result, [*values, *gradients], tolerances, strict=True):
        assert one.shape == other.shape
        assert (one.cpu() - other).norm() <= tolerance * other.norm() + 1e-30  # below, float32 ends


@cases(OPERATIONS)
def test_values_and_gradients(name, size, device):
    check(OPERATIONS[name], size, device)


@cases(ON_CPU)
def test_values_and_gradients_on_the_cpu(name, size):
    check(ON_CPU[name], size, "cpu")


@pytest.mark.parametrize("name", [name for name in ALL if name != "hash_encoding, 5 levels"])
def test_definition_by_finite_differences(name):
    operation = ALL[name]
    given = {argument: x.double() for argument, x in operation.inputs(*operation.small).items()}
    leaves = [given[leaf].requires_grad_() for leaf in operation.leaves]

    def define(*values):
        return operation.definition(**given | dict(zip(operation.leaves, values, strict=True)))

    assert torch.autograd.gradcheck(define, leaves)


@pytest.mark.parametrize("name", ALL)
def test_any_number_of_threads_gives_the_same_bits(name):
    require_same_bits(of_operation, ALL[name], ALL[name].large)


ARGUMENTS = [(name, argument) for name, each in ALL.items() for argument in each.inputs(*each.small)]


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS)
def test_a_wrong_argument_is_named(name, argument):
    operation = ALL[name]
    given = operation.inputs(*operation.small)
    of = given[argument]
    wrong = [
        (ShapeError, rf"{argument}: expected \[.*\], got \[1, ", of[None]),
        (ArgumentError, f"{argument}: expected float32, got float64", of.double()),
        (DeviceError, r": expected (device|a tensor on) .* got (meta|cpu)", of.to("meta")),
    ]
    if argument in operation.constants:
        wrong.append((ArgumentError, f"{argument}: not differentiable here", of.clone().requires_grad_()))
    for error, message, value in wrong:
        refused(lambda value=value: operation.native(**given | {argument: value}), message, error)
