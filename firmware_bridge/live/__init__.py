"""A drive watched and stopped: on the terminal, and from other computers by a web page.

The page has a process of its own. The process that drives publishes plain data and never waits:
`feed` writes what is new ten times a second into a `channel`, and leaves out what the other process
does not take. That one (`server`) speaks HTTP with as many browsers as come, with the standard
library alone.
"""
