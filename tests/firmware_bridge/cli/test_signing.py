"""`kmpc signing`: keys as ground stations make them."""

import hashlib
import io
import sys

from kmpc_lite.cli.main import main


def make_key(name="signing.key"):
    assert main(["signing", "key", name, "--json"]) == 0


def test_a_key_of_a_passphrase_is_that_of_the_ground_stations(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("correct horse\n"))
    assert main(["signing", "key", "a.key", "--passphrase"]) == 0
    text = (tmp_path / "a.key").read_text().strip()
    assert bytes.fromhex(text) == hashlib.sha256(b"correct horse").digest()
    assert (tmp_path / "a.key").stat().st_mode & 0o777 == 0o600
    assert main(["signing", "key", "a.key"]) == 2
    assert "never overwritten" in capsys.readouterr().err
    make_key("b.key")
    make_key("c.key")
    assert (tmp_path / "b.key").read_text() != (tmp_path / "c.key").read_text()
