"""Errors are one line, whatever the names in a file are."""

import pytest

import kmpc_lite as kl
from kmpc_lite.errors import KmpcError


@pytest.mark.parametrize("kind", [KmpcError, kl.DataError, kl.ScenarioError])
def test_a_name_with_a_line_break_breaks_no_message(kind):
    told = str(kind("message ve\nicle\x1b[2J: expected µm"))
    assert told == "message ve\\nicle\\x1b[2J: expected µm"
