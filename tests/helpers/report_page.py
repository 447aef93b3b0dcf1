"""A report's page as a browser reads it, and what it says."""

import json
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab import drive
from kmpc_lab.report.player import script

MODEL = kl.nominal_unicycle(0.1)
LIMITS = {"u_min": (-0.6, -np.pi / 4), "u_max": (0.6, np.pi / 4)}
ERRORS = (0.001, 0.002, 0.003), (0.011, 0.012, 0.013), (0.004, 0.005, 0.006), (0.021, 0.022, 0.023)
TOLD = replace(MODEL, info={"held_out": kl.FitReport(1.0, 1234, *ERRORS, 5.55).as_dict()})
HOSTILE = "<script>alert(1)</script>\"'& $\\frac{ \udce9"


def a_run(scenario, controller=None, **info):
    return drive(controller or kl.Controller(MODEL, scenario.problem()), scenario, info=info)


class Page(HTMLParser):
    """Reads a page as a browser would.

    Text, tags with attributes, and whether every tag is closed.
    """

    VOID = frozenset({"meta", "img", "br", "link", "hr", "input"})

    def __init__(self, path):
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.tags, self.text, self.open, self.scripts = [], [], [], []
        self.feed(self.source)
        self.close()
        assert self.open == []
        self.words = " ".join(" ".join(self.text).replace("\xa0", " ").split())

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        else:
            self.text.append(data)

    def only_our_script(self):
        """Whether the page has its data and our script, which the browser knows by its hash."""
        code, known = script()
        elements = [a for tag, a in self.tags if tag == "script"]
        policy = next(a["content"] for tag, a in self.tags if "http-equiv" in a)
        return (
            self.source.count("<script") == self.source.count("</script") == 2
            and elements == [{"id": "drive", "type": "application/json"}, {}]
            and self.scripts[1] == code
            and isinstance(json.loads(self.scripts[0]), dict)
            and policy.startswith("default-src 'none'; ")
            and f"script-src '{known}'" in policy
        )

    def svgs(self):
        return [
            b64decode(a["src"].removeprefix("data:image/svg+xml;base64,"), validate=True)
            for tag, a in self.tags
            if tag == "img"
        ]


def some(quick, more):
    """Names of runs, of which some are for `make test-long`."""
    return [*quick, *(pytest.param(name, marks=pytest.mark.long) for name in more)]
