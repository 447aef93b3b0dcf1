"""A drive watched and stopped from other computers: a web page in a process of its own.

The process that drives publishes plain data and never waits: `feed` writes what is new ten times a
second into a `channel`, and leaves out what the other process does not take. That one (`server`)
speaks HTTP with as many browsers as come, with the standard library alone.
"""
