"""How samples in files are coded, by attributes of CF: packed, missing, out of the valid range."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError

EVERYTHING = (-np.inf, np.inf)
# Attributes of CF: what stands for missing samples; how packed ones are scaled; which are valid; and others.
CODES, PACKED = ("_FillValue", "missing_value"), {"scale_factor": 1.0, "add_offset": 0.0}
NUMBERS = (*CODES, *PACKED, "valid_min", "valid_max", "valid_range")
UNSIGNED = "_Unsigned"  # "true" where integers are, although the type of the array has a sign
CF = (*NUMBERS, UNSIGNED, "axis", "standard_name", "long_name", "units", "positive")
CF += ("cartesian_axis", "grads_dim", "_CoordinateAxisType")  # of others, known to cf_xarray


def attributes_of(array: Any) -> dict[str, Any]:
    """Return the attributes of CF that an array of h5py, Zarr or xarray has, with bytes as text."""
    said = {key: np.ravel(array.attrs[key]) for key in CF if key in array.attrs}
    is_text = {key for key, values in said.items() if values.dtype.kind in "SUO" and values.size == 1}
    words = {key: said[key][0] for key in is_text}
    return said | {k: v.decode(errors="replace") if isinstance(v, bytes) else v for k, v in words.items()}


def coding_of(attributes: Mapping[str, Any], dtype: np.dtype) -> tuple[dict[str, Any], tuple[float, float]]:
    """Return how samples of a type are coded, by attributes of CF, and the range of those that are valid.

    Numbers may be written as text. Codes are as samples have them, which may have fewer digits. The range is
    that after decoding; one of whole numbers is of packed samples.
    """
    said: dict[str, np.ndarray] = {}
    for key in (each for each in NUMBERS if np.size(attributes.get(each, ())) > 0):
        values = np.ravel(attributes[key])
        try:
            values = values if values.dtype.kind in "iuf" else values.astype(np.float64)
        except ValueError:
            raise ArgumentError(f"{key}: expected a number, got {values[0]}; correct the file") from None
        with np.errstate(over="ignore"):
            said[key] = values.astype(dtype) if key in CODES and dtype.kind == "f" else values
    coding: dict[str, Any] = {key: said[key] for key in CODES if key in said}
    coding |= {key: float(said[key][0]) for key in PACKED if key in said}
    if str(attributes.get(UNSIGNED, "")).lower() == "true" and dtype.kind == "i":
        coding[UNSIGNED] = "true"
    low, high = said.get("valid_range", EVERYTHING)
    low, high = said.get("valid_min", [low])[0], said.get("valid_max", [high])[0]
    if coding.keys() & PACKED and any(np.asarray(end).dtype.kind in "iu" for end in (low, high)):
        scale, offset = (coding.get(key, default) for key, default in PACKED.items())
        low, high = sorted(((low - 0.5) * scale + offset, (high + 0.5) * scale + offset))
    return coding, (float(low), float(high))


def decoded(values: np.ndarray, coding: Mapping[str, Any], valid: tuple[float, float]) -> np.ndarray:
    """Return samples as `coding_of` says they are: packed ones are scaled, NaN stands for those that miss.

    Integers become float32 where any of this is said.
    """
    import xarray

    stored = xarray.Variable([*map(str, range(values.ndim))], values, coding)
    with warnings.catch_warnings(), np.errstate(over="ignore"):  # `prepare` tells of samples that do not fit
        warnings.simplefilter("ignore", xarray.SerializationWarning)  # of several codes
        samples = xarray.conventions.decode_cf_variable("field", stored, decode_times=False).values
        if valid != EVERYTHING:
            samples = np.where((samples < valid[0]) | (samples > valid[1]), np.nan, samples)
        is_new = samples.dtype.kind == "f" != values.dtype.kind
        return samples.astype(np.float32) if is_new else samples
