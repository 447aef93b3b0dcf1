"""Model files: what is saved comes back bit for bit, and no damaged or foreign file gets past
`load`.
"""

import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.model.bilinear import BilinearForm
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.symmetric import SymmetricForm

TRIG = kl.HermiteTrigDictionary(0)
INFO = {
    "method": "integral",
    "samples": 1234,
    "condition": 1 / 3,
    "robot": "Käfer 7",
    "empty": None,
}


def make_model(
    dictionary: kl.Dictionary, continuous: bool = True, noisy: bool = True
) -> kl.KoopmanModel:
    """A model of irrational numbers, with everything that a file must keep."""
    random = np.random.default_rng(3)
    nz, nw = dictionary.size, dictionary.input_size
    rows = 3 if continuous else nz
    a, b, h, c = (
        random.normal(size=shape) for shape in ((rows, nz), (rows, nw), (rows, nw * nz), (3, rows))
    )
    roots = random.normal(size=(3, 3, 3))
    noise = NoiseModel(roots @ roots.transpose(0, 2, 1)) if noisy else None
    return kl.KoopmanModel(dictionary, 0.1 / 3, a, b, h, c, continuous, noise, INFO)


def assert_same(model: Any, other: Any) -> None:
    """Every field of two models, or of their bilinear forms, the same to the last bit."""
    assert type(model) is type(other)
    for name in (f.name for f in fields(model)):
        mine, theirs = getattr(model, name), getattr(other, name)
        if isinstance(mine, np.ndarray):
            assert mine.dtype == theirs.dtype
            np.testing.assert_array_equal(mine, theirs)
        elif isinstance(mine, NoiseModel):
            np.testing.assert_array_equal(mine.coefficients, theirs.coefficients)
        elif isinstance(mine, BilinearForm | SymmetricForm):
            assert_same(mine, theirs)
        elif name == "dictionary":
            assert (type(mine), mine.config()) == (type(theirs), theirs.config())
        else:
            assert mine == theirs, name


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A good model file."""
    path = tmp_path / "robot.npz"
    make_model(kl.UnicycleDictionary()).save(path)
    return path


@pytest.mark.parametrize(
    "dictionary",
    [
        kl.UnicycleDictionary(),
        kl.HermiteTrigDictionary(2, harmonics=2),
        kl.InputHistoryDictionary(TRIG, lags=(1, 3), product=True),
    ],
)
@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("noisy", [True, False])
def test_what_is_saved_comes_back_bit_for_bit(
    tmp_path: Path, dictionary: kl.Dictionary, continuous: bool, noisy: bool
) -> None:
    model = make_model(dictionary, continuous, noisy)
    model.save(tmp_path / "a model")
    loaded = kl.KoopmanModel.load(tmp_path / "a model")
    assert_same(model, loaded)
    u, past = np.array([0.4, -0.3]), np.full((model.history, 2), 0.1)
    np.testing.assert_array_equal(
        model.predict(np.ones(3), u, past), loaded.predict(np.ones(3), u, past)
    )
    np.testing.assert_array_equal(model.noise(u), loaded.noise(u))


class Planar(kl.Dictionary):
    """A user's own dictionary: only what must be given."""

    @property
    def names(self) -> tuple[str, ...]:
        return ("1", "cos", "sin")

    def lift(self, x: np.ndarray) -> np.ndarray:
        return np.stack([np.ones(x.shape[:-1]), np.cos(x[..., 2]), np.sin(x[..., 2])], axis=-1)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        jac = np.zeros((*x.shape[:-1], 3, 3))
        jac[..., 1, 2], jac[..., 2, 2] = -np.sin(x[..., 2]), np.cos(x[..., 2])
        return jac


def test_a_dictionary_of_ones_own(tmp_path: Path) -> None:
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=5, steps=50, dt=0.1, seed=0
    )
    model = kl.fit(data, Planar())
    np.testing.assert_allclose(
        model.linearize(np.ones(3), np.ones(2)).A,
        kl.nominal_unicycle(0.1).linearize(np.ones(3), np.ones(2)).A,
        atol=1e-6,
    )
    model.save(tmp_path / "own.npz")
    assert_same(model, kl.KoopmanModel.load(tmp_path / "own.npz", dictionary=Planar()))
    with pytest.raises(kl.ModelError, match="unknown dictionary kind 'custom'"):
        kl.KoopmanModel.load(tmp_path / "own.npz")


def test_a_flipped_byte_never_changes_a_model(saved: Path) -> None:
    whole, model = saved.read_bytes(), kl.KoopmanModel.load(saved)
    random, refused = np.random.default_rng(0), 0
    for position in range(0, len(whole), 5):
        damaged = bytearray(whole)
        damaged[position] ^= int(random.integers(1, 256))
        saved.write_bytes(damaged)
        try:
            # a zip file has dates and permissions too, where a flip harms nothing
            assert_same(model, kl.KoopmanModel.load(saved))
        except kl.ModelError:
            refused += 1
    assert refused > 0.8 * len(whole) / 5


def test_a_flip_in_the_numbers_or_the_type_of_an_array_is_a_model_error(saved: Path) -> None:
    whole = saved.read_bytes()
    with zipfile.ZipFile(saved) as archive:
        starts = [whole.index(archive.read(name)) for name in archive.namelist()]
        ends = [
            start + archive.getinfo(name).file_size
            for start, name in zip(starts, archive.namelist(), strict=True)
        ]
    for start, end in zip(starts, ends, strict=True):
        # half precision and other lengths pass NumPy's reader, which then never sees the checksum
        types = [whole.find(b"<f8", start, end)] if b"<f8" in whole[start:end] else []
        changes = [(t + 2, 0x38 ^ 0x34) for t in types] + [
            (p, 0x01) for p in range(start, end, max(1, (end - start) // 20))
        ]
        for position, mask in changes:
            damaged = bytearray(whole)
            damaged[position] ^= mask
            saved.write_bytes(damaged)
            with pytest.raises(kl.ModelError, match="damaged"):
                kl.KoopmanModel.load(saved)


class Bomb:
    """What a hostile pickle does."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return os.mkdir, ("harmed",)


def as_bytes(save: Callable[[io.BytesIO], Any]) -> bytes:
    """What a function writes."""
    out = io.BytesIO()
    save(out)
    return out.getvalue()


FOREIGN = {
    "empty": b"",
    "text": b"not a model\n",
    "pickle": pickle.dumps(Bomb()),
    "npy under another name": as_bytes(lambda f: np.save(f, np.zeros(3))),
    "npz of something else": as_bytes(lambda f: np.savez(f, t=np.zeros(3), x=np.zeros(3))),
    "compressed npz of something else": as_bytes(lambda f: np.savez_compressed(f, t=np.zeros(3))),
    "npz of nothing": as_bytes(lambda f: np.savez(f)),
    "pickle in an npz": as_bytes(lambda f: np.savez(f, header=np.array([Bomb()], dtype=object))),
    "header that is no text": as_bytes(lambda f: np.savez(f, header=np.arange(3))),
    "header of another program": as_bytes(
        lambda f: np.savez(f, header=np.array('{"format": "other"}'))
    ),
    "header that is a list": as_bytes(lambda f: np.savez(f, header=np.array("[1, 2]"))),
    "header without end": as_bytes(lambda f: np.savez(f, header=np.array("[" * 100_000))),
}


@pytest.mark.parametrize("content", FOREIGN.values(), ids=FOREIGN.keys())
def test_a_foreign_file_is_a_model_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("foreign.npz").write_bytes(content)
    with pytest.raises(kl.ModelError, match="foreign.npz") as caught:
        kl.KoopmanModel.load("foreign.npz")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300
    assert not Path("harmed").exists()


def rewrite(
    path: Path, header: dict[str, Any] | None = None, drop: str = "", **arrays: Any
) -> None:
    """Replace parts of a good model file."""
    with np.load(path) as archive:
        content = {name: archive[name] for name in archive.files}
    old = json.loads(str(content["header"]))
    content["header"] = np.array(
        json.dumps({k: v for k, v in {**old, **(header or {})}.items() if k != drop})
    )
    content.update(arrays)
    content.pop(drop, None)
    np.savez(path, **content)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"header": {"version": 2}}, "version 2.*update kmpc_lite"),
        ({"header": {"info": 3}}, "info"),
        ({"header": {"dictionary": {"kind": "hermite_trig", "order": 10**9}}}, "order"),
        ({"drop": "dt"}, "dt"),
        ({"noise": np.full((3, 3, 3), "a")}, "noise"),
    ],
)
def test_a_model_of_another_kind_is_a_model_error(saved: Path, change: dict[str, Any], words: str):
    rewrite(saved)
    kl.KoopmanModel.load(saved)
    rewrite(saved, **change)
    with pytest.raises(kl.ModelError, match=words):
        kl.KoopmanModel.load(saved)
