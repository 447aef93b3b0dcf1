"""The paper's two robot experiments on the digital twin, through real bytes and the safety gate, faster than real time.

``python -m firmware_bridge.experiments --help``
"""
