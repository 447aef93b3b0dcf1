"""The HTML report of a run, and its picture.

Matplotlib (``pip install 'kmpc-lab[plot]'``) is needed only when something is drawn.
"""
