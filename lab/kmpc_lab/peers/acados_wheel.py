"""Where acados comes from: one version of its wheel, laid out as its templates expect.

acados is no dependency. `install` fetches the wheel ``comma-deps-acados`` (x86-64 Linux, acados
0.2.2), one version with one hash, into a folder of its own: the wheel brings a CasADi that would
replace the real one, so that part is thrown away. A C compiler and make are needed.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from kmpc_lite.errors import KmpcError

WHEEL = "comma-deps-acados==0.2.2.post92"
WHEEL_HASH = "sha256:fb317ea65c68d410e19b46f824c333203a097d02dac6fbbdc1f378c2b32b456f"
"""The one file that was tested: it brings programs that are run, so no other is installed."""


def default_folder() -> Path:
    """Folder that `install` uses: under the user's cache."""
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "kmpc_lite" / "acados"


def why_not(folder: Path | None = None) -> str:
    """Say in a few words why acados cannot be used here; empty if it can."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return f"the wheel is for x86-64 Linux, this is {platform.system()} {platform.machine()}"
    if not (shutil.which("gcc") or shutil.which("cc")) or not shutil.which("make"):
        return "a C compiler and make are needed"
    if importlib.util.find_spec("casadi") is None:
        return "CasADi is needed: pip install 'kmpc-lab[peers]'"
    if not ((folder or default_folder()) / "acados" / "install").is_dir():
        return "not installed: kmpc bench --install-acados"
    return ""


def install(folder: Path | None = None) -> Path:
    """Put the wheel into a folder, without the CasADi that comes with it.

    Raises KmpcError if pip fails, as for a wheel of another hash; with pip's last line.
    """
    target = folder or default_folder()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        wanted = Path(scratch) / "wanted.txt"
        wanted.write_text(f"{WHEEL} --hash={WHEEL_HASH}\n", encoding="ascii")
        checked = ("--no-deps", "--only-binary=:all:", "--require-hashes", "-r", str(wanted))
        command = [sys.executable, "-m", "pip", "install", "--quiet", *checked, "--target", scratch]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise KmpcError(
                f"pip could not install {WHEEL}: "
                f"{(done.stderr.strip().splitlines() or ['no output'])[-1]}"
            )
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        shutil.move(str(Path(scratch) / "acados"), target / "acados")
    return target


def prepare(folder: Path) -> Path:
    """Lay out what acados' templates expect and load its libraries; returns the layout's root.

    The environment variables that acados reads are set, too.
    """
    package = folder / "acados"
    root = folder / "root"
    links = {
        "lib": package / "install/lib",
        "include": package / "install/include",
        "bin": package / "install/bin",
        "interfaces/acados_template/acados_template": package / "acados_template",
    }
    for name, target in links.items():
        link = root / name
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.is_symlink():
            link.symlink_to(target)
    os.environ["ACADOS_SOURCE_DIR"] = str(root)
    os.environ["TERA_PATH"] = str(package / "install/bin/t_renderer")
    # loaded here and for all, the generated solver finds them without LD_LIBRARY_PATH, which would
    # come too late now
    for library in ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so", "libacados.so"):
        ctypes.CDLL(str(package / "install/lib" / library), mode=ctypes.RTLD_GLOBAL)
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    return root
