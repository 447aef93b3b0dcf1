"""One version stands everywhere; links of what is published hold outside the repository."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def release():
    spec = importlib.util.spec_from_file_location("release", ROOT / ".ci" / "release.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def copied(release, folder, monkeypatch):
    for place in (*release.PLACES, "CHANGELOG.md"):
        target = folder / place.strip()
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / place.strip(), target)
    monkeypatch.setattr(release, "ROOT", folder)


def test_the_version_is_the_same_everywhere(release) -> None:
    assert release.VERSION.fullmatch(release.version())


def test_versions_that_differ_are_refused(release, tmp_path, monkeypatch) -> None:
    copied(release, tmp_path, monkeypatch)
    release.set_version("7.0.0.dev1")
    assert release.version() == "7.0.0.dev1"
    cited = tmp_path / "CITATION.cff"
    cited.write_text(cited.read_text().replace("7.0.0.dev1", "6.9.9"))
    for ask in (release.version, release.tag):
        with pytest.raises(SystemExit, match="the versions differ"):
            ask()
    with pytest.raises(SystemExit, match="expected a version"):
        release.set_version("7")


def test_only_a_release_is_tagged(release, tmp_path, monkeypatch) -> None:
    copied(release, tmp_path, monkeypatch)
    release.set_version("7.0.0.dev1")
    with pytest.raises(SystemExit, match="make version V=7.0.0"):
        release.tag()
    release.set_version("7.0.0")
    with pytest.raises(SystemExit, match=r"expected the first release to be ## \[7.0.0\]"):
        release.tag()


@pytest.mark.parametrize("part", [".", "lab"])
def test_links_of_what_is_published_are_absolute(release, tmp_path, part) -> None:
    folder = tmp_path / "part"
    folder.mkdir()
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(ROOT / part / name, folder)
    release._lead_outside(folder, "https://example.org/a/b", "v7.0.0")
    links = release.LINK.findall((folder / "README.md").read_text())
    assert links == []
    text = (folder / "README.md").read_text()
    assert "](https://example.org/a/b/blob/v7.0.0/" in text and "REPOSITORY" not in text
    assert 'Repository = "https://example.org/a/b"' in (folder / "pyproject.toml").read_text()


def test_an_sdist_has_the_same_bytes_whenever_and_by_whomever_it_was_packed(release, tmp_path):
    source, file, found = tmp_path / "one.tar.gz", tmp_path / "file", []
    file.write_text("text")
    for seconds in (1.0e9, 1.1e9):
        os.utime(file, (seconds, seconds))
        with tarfile.open(source, "w:gz") as packed:
            packed.add(file, "part/file")
        release._pack_anew(source, 1_700_000_000)
        found.append(source.read_bytes())
    assert found[0] == found[1]
    with tarfile.open(source) as packed:
        assert packed.extractfile("part/file").read() == b"text"


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="no shellcheck on this machine")
def test_the_script_for_a_raspberry_pi_is_clean() -> None:
    assert subprocess.run(["shellcheck", "examples/raspberry_pi.sh"], cwd=ROOT).returncode == 0


def test_the_script_for_a_raspberry_pi_only_shows_what_it_does_when_asked_to() -> None:
    if sys.platform != "linux" or shutil.which("apt-get") is None:
        pytest.skip("no Debian")
    done = subprocess.run(
        ["examples/raspberry_pi.sh", "--dry-run", "--user", "nobody"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "would write: /etc/systemd/system/kmpc-bridge.service" in done.stdout
    assert "run: /opt" not in done.stdout.replace("would run:", "")
