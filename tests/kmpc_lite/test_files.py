"""Archives are distrusted, and files are written whole, into no other's place."""

import io
import os
import stat
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from kmpc_lite.files import read_npz, write_whole


def npy(header: str, body: bytes = b"") -> bytes:
    """An array file with a header of our own."""
    text = header.encode() + b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body


def archive(path: Path, how: int = zipfile.ZIP_DEFLATED, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", how) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return path


def header(shape: str, dtype: str = "<f8") -> str:
    return f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}"


def saved(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


BAD = {
    "ten thousand million numbers": npy(header("(10000000000,)")),
    "bytes that become numbers": npy(header("(1000, 1000)", "|i1"), bytes(10**6)),
    "more digits than Python reads": npy(header("(" + 5000 * "1" + ",)")),
    "a shape below zero": npy(header("(-1,)")),
    "objects": npy(header("(1,)", "|O")),
    "nested": npy(header("(" + 5000 * "(" + "1,)")),
    "an end that comes early": npy(header("(10,)"), bytes(79)),
    "more behind its end": npy(header("(10,)"), bytes(81)),
    "another version": b"\x93NUMPY\x03\x00" + npy(header("(1,)"), bytes(8))[8:],
    "no array": b"hello",
}


@pytest.mark.parametrize("name", BAD)
def test_an_array_is_refused_before_it_takes_memory(tmp_path: Path, name: str) -> None:
    path = archive(tmp_path / "it.npz", a=BAD[name])
    tracemalloc.start()
    try:
        with pytest.raises(ValueError) as error:
            read_npz(path, ("a",), most=2**22)
        assert tracemalloc.get_traced_memory()[1] < 2**22
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)


def test_a_packing_that_unpacks_at_once_is_refused(tmp_path: Path) -> None:
    path = archive(tmp_path / "it.npz", zipfile.ZIP_LZMA, a=saved(np.zeros(3)))
    with pytest.raises(ValueError, match="packed in a way"):
        read_npz(path, ("a",))


def test_a_directory_is_not_believed_to_be_as_long_as_it_says(tmp_path: Path) -> None:
    content = bytearray(archive(tmp_path / "it.npz", a=saved(np.zeros(3))).read_bytes())
    padding = 2**26
    place = content.rfind(b"PK\x05\x06") + 12
    size = int.from_bytes(content[place : place + 4], "little")
    content[place : place + 4] = (size + padding).to_bytes(4, "little")
    at = content.find(b"PK\x01\x02")
    with open(tmp_path / "it.npz", "wb") as file:
        file.write(content[:at])
        file.seek(padding, os.SEEK_CUR)
        file.write(content[at:])
    tracemalloc.start()
    try:
        with pytest.raises(ValueError):
            read_npz(tmp_path / "it.npz", ("a",))
        assert tracemalloc.get_traced_memory()[1] < padding / 4
    finally:
        tracemalloc.stop()


def test_the_name_of_a_temporary_file_cannot_be_foreseen(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("mine")
    seen: list[str] = []
    for _ in range(2):
        # as earlier versions named it
        (tmp_path / f"it.{os.getpid()}.part").unlink(missing_ok=True)
        (tmp_path / f"it.{os.getpid()}.part").symlink_to(other)
        with write_whole(tmp_path / "it") as file:
            seen += {f.name for f in tmp_path.iterdir()} - {"it", "other", *seen}
            file.write(b"new")
    assert other.read_text() == "mine" and (tmp_path / "it").read_bytes() == b"new"
    assert len(seen) == 3  # the link, and two names


def test_a_written_file_has_the_usual_mode_and_follows_links(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("target")
    with write_whole(tmp_path / "link") as file:
        file.write(b"new")
    (tmp_path / "plain").write_bytes(b"")
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "target")}
    assert len(modes) == 1 and (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"


def test_nothing_is_left_of_what_fails(tmp_path: Path) -> None:
    (tmp_path / "it").write_text("old")
    with pytest.raises(ZeroDivisionError), write_whole(tmp_path / "it") as file:
        file.write(bytes(1 // int(file.tell())))
    assert [f.name for f in tmp_path.iterdir()] == ["it"]
    assert (tmp_path / "it").read_text() == "old"
