"""The numeric functions of a step, in C: C-contiguous float64 arrays in, arrays out.

`library` describes and calls them; the other modules have what stands around them
in Python. `pip install` builds them with any C compiler; an exported controller runs the same
files. Naive references of them are in the tests.
"""

from importlib.util import find_spec

if find_spec("kmpc_lite.control.kernels._kernels") is None:
    raise ImportError(
        "kmpc_lite: its functions in C were not built: install a C compiler (apt install gcc "
        "python3-dev), then kmpc-lite again"
    )
