"""What a model file holds: the model, how fast its robot changes its speeds, what made it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.files import read_npz, write_whole
from kmpc_lite.model.dictionary import Dictionary, dictionary_from_config, dictionary_to_config
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel, NoiseSources
from kmpc_lite.types import Array

FREE = np.inf  # limit of a robot that follows at once
FORMAT = "kmpc_lite.model"
MAX_BYTES = 2**26  # memory of the largest model: some thousand lifted coordinates
VERSION = 1


class Ramps(NamedTuple):
    """Largest changes of each number of a command, (m,) each [m/s^2, rad/s^2].

    Of a car the second one is that of its curvature [1/m per second].
    """

    faster: Array  # away from zero; infinite if no ramp is known
    slower: Array  # towards zero

    @property
    def limit(self) -> bool:
        """Whether they limit anything."""
        return bool(np.isfinite(self).any())

    def within(self, other: Ramps) -> Ramps:
        """The slower of two ramps in each direction."""
        return Ramps(*np.minimum(self, other))

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a model's `info`; None if nothing is limited."""
        return {
            name: [float(v) if np.isfinite(v) else None for v in values]
            for name, values in self._asdict().items()
        }

    @classmethod
    def of(cls, info: Mapping[str, Any], name: str = "ramps") -> Ramps:
        """Read them from a model's `info`; those of a robot without any where it tells none."""
        told = info.get(name) or dict.fromkeys(cls._fields, [None])  # of any m
        faster, slower = (
            np.array([FREE if v is None else float(v) for v in told[side]]) for side in cls._fields
        )
        return cls(faster, slower)


def check_info(info: Mapping[str, Any]) -> None:
    """Check what margins, guidance and reports read in a model's `info`; other values may be any.

    Raises ModelError: names the value that is not what a fit leaves there.
    """
    for name, (is_right, expected) in KNOWN.items():
        if name in info and not is_right(info[name]):
            raise ModelError(f"info.{name}: expected {expected}")


def _is_number(value: Any) -> bool:
    kind = isinstance(value, int | float) and not isinstance(value, bool)
    return kind and abs(value) < 1e300 and math.isfinite(value)


def _is_count(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_gains(value: Any) -> bool:
    """Gains that were learned while driving; other entries may stand beside them."""
    names = ("ahead", "left", "turn")
    return isinstance(value, Mapping) and all(_is_number(value.get(n, 0.0)) for n in names)


def _is_errors(value: Any) -> bool:
    """Held-out errors: numbers, and forward, left and heading."""
    return isinstance(value, Mapping) and all(
        _is_number(v) or (isinstance(v, list | tuple) and len(v) == 3 and all(map(_is_number, v)))
        for v in value.values()
    )


def _is_quantiles(value: Any) -> bool:
    """A table of calibrated quantiles by falling risks."""
    if not isinstance(value, Mapping):
        return False
    risks, quantiles = value.get("risks"), value.get("quantiles")
    if not isinstance(risks, list | tuple) or not isinstance(quantiles, list | tuple):
        return False
    return (
        len(risks) == len(quantiles) >= 2
        and all(map(_is_number, [*risks, *quantiles]))
        and all(1.0 > a > b > 0.0 for a, b in zip(risks, risks[1:], strict=False))
        and min(quantiles) >= 0.0
    )


def is_vehicle(value: Any) -> bool:
    """Whether this describes a vehicle: names and plain values, not many of them."""
    return (
        isinstance(value, Mapping)
        and len(value) <= 32
        and all(isinstance(key, str) and len(key) <= 64 for key in value)
        and all(
            isinstance(v, bool) or _is_number(v) or (isinstance(v, str) and len(v) <= 200)
            for v in value.values()
        )
    )


def _is_speeds(value: Any) -> bool:
    """Largest speeds that were driven: none is negative."""
    names = ("forward", "reverse", "turn")
    return isinstance(value, Mapping) and all(
        _is_number(value.get(n)) and value[n] >= 0.0 for n in names
    )


def _is_stopping(value: Any) -> bool:
    """Delay and deceleration of a stopping robot."""
    if not isinstance(value, Mapping) or not _is_number(value.get("delay")):
        return False
    deceleration = value.get("deceleration")
    slows = deceleration is None or (_is_number(deceleration) and deceleration > 0.0)
    return value["delay"] >= 0.0 and slows and _is_number(value.get("stops"))


def _is_ramps(value: Any) -> bool:
    """Limits of each speed, away from zero and towards it; None if there is none."""
    return isinstance(value, Mapping) and all(
        isinstance(limits := value.get(name), list | tuple)
        and len(limits) in (2, 3)
        and all(v is None or (_is_number(v) and v > 0.0) for v in limits)
        for name in ("faster", "slower")
    )


def _is_wheels(value: Any) -> bool:
    """A kind of wheels, and what that takes."""
    return is_vehicle(value) and value.get("kind") in ("differential", "car", "omni")


def _is_outline(value: Any) -> bool:
    """Corners of an outline, x and y each."""
    return (
        isinstance(value, list | tuple)
        and 3 <= len(value) <= 100
        and all(
            isinstance(p, list | tuple) and len(p) == 2 and all(map(_is_number, p)) for p in value
        )
    )


KNOWN: dict[str, tuple[Callable[[Any], bool], str]] = {
    "samples": (_is_count, "a number of samples"),
    "condition": (lambda v: isinstance(v, float) or _is_number(v), "a number"),  # infinity, too
    "unmodelled_delay": (lambda v: _is_number(v) and 0.0 <= v <= 10.0, "a time from 0 to 10 s"),
    "adaptation": (_is_gains, "a table of gains"),
    "held_out": (_is_errors, "a table of errors"),
    "noise_quantiles": (_is_quantiles, "risks and their quantiles: calibrate it anew"),
    "ramps": (_is_ramps, "limits faster and slower of each speed, above zero or null"),
    "changes": (_is_ramps, "limits faster and slower of each speed, above zero or null"),
    "driven": (_is_speeds, "the largest speeds forward, reverse and turn"),
    "stopping": (_is_stopping, "delay, stops and deceleration"),
    "vehicle": (is_vehicle, "a table of plain values"),
    "wheels": (_is_wheels, "a table of the kind of the wheels, and of what it takes"),
    "radius": (_is_count, "the robot's radius"),
    "footprint": (_is_outline, "corners of the robot's outline"),
}


def save_model(model: KoopmanModel, path: str | os.PathLike[str]) -> None:
    """Write a model; see `KoopmanModel.save`."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "dictionary": dictionary_to_config(model.dictionary),
        "dt": model.dt,
        "continuous": bool(model.continuous),
        "integrator": model.integrator,
        "info": dict(model.info),
    }
    noise = np.empty((0,)) if model.noise_model is None else model.noise_model.coefficients
    found = None if model.noise_model is None else model.noise_model.sources
    more = {} if found is None else {"noise_sources": found.as_array()}
    try:
        text = np.array(json.dumps(header))
        with write_whole(path) as file:
            np.savez(
                file,
                allow_pickle=False,
                header=text,
                A=model.A,
                B=model.B,
                H=model.H,
                C=model.C,
                noise=noise,
                **more,
            )
    except OSError as error:
        raise ModelError(f"{path}: cannot write the model: {error.strerror or error}") from error
    except (TypeError, ValueError) as error:
        raise ModelError(f"{path}: cannot write the model: {error}") from error


def load_model(path: str | os.PathLike[str], dictionary: Dictionary | None = None) -> KoopmanModel:
    """Read a model; see `KoopmanModel.load`."""
    try:
        wanted = ("header", "A", "B", "H", "C", "noise", "noise_sources")
        arrays, names = read_npz(path, wanted, MAX_BYTES)
    except OSError as error:
        raise ModelError(f"{path}: cannot read the model: {error.strerror or error}") from error
    except ValueError as error:
        raise ModelError(f"{path}: not a kmpc_lite model, or damaged: {error}") from error
    if "header" not in arrays:
        raise ModelError(
            f"{path}: an npz file, but not a kmpc_lite model (it has "
            f"{', '.join(names[:10]) or 'nothing'})"
        )
    try:
        header = json.loads(str(arrays.pop("header")))
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{path}: damaged model header: {error}") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ModelError(f"{path}: not a kmpc_lite model")
    if header.get("version") != VERSION:
        raise ModelError(
            f"{path}: model format version {header.get('version')}, "
            f"this kmpc_lite reads version {VERSION}: update kmpc_lite"
        )
    try:
        noise = arrays.pop("noise")
        sources = arrays.pop("noise_sources", None)
        told = None if sources is None else NoiseSources.from_array(sources)
        if not isinstance(header["info"], dict) or not isinstance(header["continuous"], bool):
            raise TypeError("expected info to be a table and continuous true or false")
        check_info(header["info"])
        return KoopmanModel(
            dictionary=dictionary_from_config(header["dictionary"])
            if dictionary is None
            else dictionary,
            dt=header["dt"],
            continuous=header["continuous"],
            integrator=header["integrator"],
            noise_model=NoiseModel(noise, told) if noise.size else None,
            info=header["info"],
            **arrays,
        )
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ModelError(f"{path}: damaged model: {error}") from error
