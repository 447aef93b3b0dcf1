"""Models as npz files: numbers and JSON, no pickle."""

from __future__ import annotations

import json
import os

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.files import read_npz, write_whole
from kmpc_lite.model.dictionary import Dictionary, dictionary_from_config, dictionary_to_config
from kmpc_lite.model.info import check_info
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel, NoiseSources

FORMAT = "kmpc_lite.model"
MAX_BYTES = 2**26
"""Memory of the largest model: some thousand lifted coordinates."""
VERSION = 1


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
