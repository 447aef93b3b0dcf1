"""Pictures and the HTML report of a run.

Matplotlib (``pip install 'kmpc-lab[plot]'``) is needed only when something is drawn.
"""

from kmpc_lab.report.html import write_report
from kmpc_lab.report.maps import map_picture
from kmpc_lab.report.overlay import overlay_picture
from kmpc_lab.report.pictures.commands import commands_picture
from kmpc_lab.report.pictures.errors import errors_picture
from kmpc_lab.report.pictures.files import write_beside, write_pictures
from kmpc_lab.report.pictures.fit import fit_picture
from kmpc_lab.report.pictures.timing import timing_picture

__all__ = [
    "commands_picture",
    "errors_picture",
    "fit_picture",
    "map_picture",
    "overlay_picture",
    "timing_picture",
    "write_beside",
    "write_pictures",
    "write_report",
]
