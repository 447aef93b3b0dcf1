"""One version everywhere, and what is published of it.

``make version V=0.4.0.dev0`` sets it, ``make tag`` marks a release, ``make dist URL=ADDRESS``
builds.
"""

from __future__ import annotations

import gzip
import io
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from shutil import which

ROOT = Path(__file__).parents[1]
PLACES = {
    "pyproject.toml": r'^version = "(.+)"$',
    "kmpc_lite/__init__.py": r'^__version__ = "(.+)"$',
    "lab/pyproject.toml": r'^version = "(.+)"$',
    "lab/pyproject.toml ": r'^dependencies = \["kmpc-lite==([^"]+)"',
    "lab/kmpc_lab/__init__.py": r'^__version__ = "(.+)"$',
    "CITATION.cff": r"^version: (.+)$",
}
"""Where the version stands: files, and patterns of its line."""
VERSION = re.compile(r"\d+\.\d+\.\d+(\.dev\d+)?")
RELEASE = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - \d{4}-\d{2}-\d{2}$", re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:|#)(?:\.\./)?([^)\s]+)\)")
CROSS = "aarch64-linux-gnu-gcc"
PICTURES = (".gif", ".png", ".svg")


def version() -> str:
    """Give the version; ends the program if two places differ."""
    found = {place: _match(place)[1] for place in PLACES}
    if len(set(found.values())) > 1:
        lines = "\n".join(f"  {place.strip()}: {value}" for place, value in found.items())
        sys.exit(f"the versions differ; make version V=... sets all of them:\n{lines}")
    return found["pyproject.toml"]


def set_version(new: str) -> None:
    """Write a version to all places."""
    if not VERSION.fullmatch(new):
        sys.exit(f"V={new}: expected a version as 0.3.0, or 0.4.0.dev0 between releases")
    for place in PLACES:
        file, found = ROOT / place.strip(), _match(place)
        file.write_text(found.string[: found.start(1)] + new + found.string[found.end(1) :])
    sys.stdout.write(f"version {version()} in {len(PLACES)} places\n")


def tag() -> None:
    """Tag the present commit as a release, if everything says that it is one."""
    now = version()
    latest = RELEASE.search((ROOT / "CHANGELOG.md").read_text())
    if ".dev" in now:
        sys.exit(f"version {now} is none of a release: make version V={now.partition('.dev')[0]}")
    if latest is None or latest[1] != now:
        sys.exit(f"CHANGELOG.md: expected the first release to be ## [{now}] - YYYY-MM-DD")
    if changed := _git("status", "--porcelain"):
        sys.exit(f"not committed:\n{changed}")
    _git("tag", "-a", f"v{now}", "-m", f"kmpc_lite {now}")
    sys.stdout.write(f"tagged v{now}; next: git push origin v{now}; make version V=...\n")


def build(url: str) -> None:
    """Build sdists and wheels of both distributions from the present commit, and check them.

    The same commit gives the same bytes: times are the commit's, and no folder's name is in them.
    """
    if not re.fullmatch(r"https://[^/\s]+/\S+[^/\s]", url):
        sys.exit("make dist URL=https://HOST/OWNER/REPOSITORY: links and metadata lead there")
    now, seconds = version(), _git("log", "-1", "--format=%ct")
    at = "main" if ".dev" in now else f"v{now}"
    os.environ.update(SOURCE_DATE_EPOCH=seconds, CFLAGS="-g0")
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, capture_output=True)
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
        for part in (Path(folder), Path(folder) / "lab"):
            _lead_outside(part, url, at)
            _run("-m", "build", "--quiet", "--outdir", str(ROOT / "dist"), str(part))
        if which(CROSS):  # boards install it without a compiler
            names = {"CC": CROSS, "LDSHARED": f"{CROSS} -shared"}
            os.environ.update(names, _PYTHON_HOST_PLATFORM="linux-aarch64")
            _run("-m", "build", "--quiet", "--wheel", "--outdir", str(ROOT / "dist"), folder)
    for source in (ROOT / "dist").glob(f"*{now}.tar.gz"):
        _pack_anew(source, int(seconds))
    built = sorted(map(str, (ROOT / "dist").glob(f"*{now}*")))
    _run("-m", "twine", "check", "--strict", *built)
    sys.stdout.write("\n".join(built) + "\n")


def _pack_anew(source: Path, seconds: int) -> None:
    """Pack an sdist in order, every file of one time and of nobody."""
    packed = io.BytesIO()
    with tarfile.open(source) as old, tarfile.open(fileobj=packed, mode="w") as new:
        for member in sorted(old.getmembers(), key=lambda one: one.name):
            content = old.extractfile(member) if member.isfile() else None
            member.mtime, member.uid, member.gid, member.uname, member.gname = seconds, 0, 0, "", ""
            member.pax_headers = {}
            new.addfile(member, content)
    source.write_bytes(gzip.compress(packed.getvalue(), mtime=seconds))


def _lead_outside(part: Path, url: str, at: str) -> None:
    """Make links of a README absolute, and put addresses into the metadata."""

    def absolute(link: re.Match[str]) -> str:
        target = link[1].partition("#")[0]
        if not (ROOT / target).exists():
            sys.exit(f"{part.name}/README.md: links to {target}, which is not there")
        kind = "raw" if target.endswith(PICTURES) else "blob"
        return f"]({url}/{kind}/{at}/{link[1]})"

    readme, project = part / "README.md", part / "pyproject.toml"
    readme.write_text(LINK.sub(absolute, readme.read_text()).replace("REPOSITORY", url))
    pages = {
        "Repository": url,
        "Documentation": f"{url}/blob/{at}/docs/index.md",
        "Changelog": f"{url}/blob/{at}/CHANGELOG.md",
        "Issues": f"{url}/issues",
    }
    lines = "\n".join(f'{name} = "{page}"' for name, page in pages.items())
    project.write_text(f"{project.read_text()}\n[project.urls]\n{lines}\n")


def _match(place: str) -> re.Match[str]:
    found = re.search(PLACES[place], (ROOT / place.strip()).read_text(), re.MULTILINE)
    return found or sys.exit(f"{place.strip()}: expected a line {PLACES[place]}")


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else sys.exit(done.stderr.strip())


def _run(*words: str) -> None:
    if status := subprocess.run([sys.executable, *words]).returncode:
        sys.exit(status)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["version", *new]:
            set_version(new[0]) if new else sys.stdout.write(f"{version()}\n")
        case ["tag"]:
            tag()
        case ["dist", *url]:
            build(url[0] if url else "")
        case _:
            sys.exit(__doc__)
