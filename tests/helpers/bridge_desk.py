"""Where tests of the bridge's commands are run."""

import pytest
from courses import COURSE


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder of its own, with a course and no emergency stop from elsewhere."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    for name in ("SERVICES", "USERS"):  # no robot of this machine's is ours to stop
        monkeypatch.setattr(f"firmware_bridge.safety.places.{name}", tmp_path / "none")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "course.toml").write_text(COURSE)
    return tmp_path
