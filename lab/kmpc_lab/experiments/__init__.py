"""The paper's two robot experiments on the digital twin, faster than real time.

They go through real bytes and the safety gate.

``python -m kmpc_lab.experiments --help``
"""
