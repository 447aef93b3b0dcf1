"""Pictures and the HTML report of a run.

Matplotlib (``pip install 'kmpc-lite[plot]'``) is needed only when something is drawn.
"""

from kmpc_lite.report.html import write_report
from kmpc_lite.report.maps import map_picture, overlay_picture
from kmpc_lite.report.pictures import (
    commands_picture,
    errors_picture,
    fit_picture,
    timing_picture,
    write_pictures,
)

__all__ = [
    "commands_picture",
    "errors_picture",
    "fit_picture",
    "map_picture",
    "overlay_picture",
    "timing_picture",
    "write_pictures",
    "write_report",
]
