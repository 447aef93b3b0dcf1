"""The commands of the bridge: they become commands of `kmpc` through entry points."""

COMMANDS = {
    name: f"firmware_bridge.cli.{name}:COMMAND"
    for name in (
        "demo",
        "init",
        "check",
        "run",
        "record",
        "replay",
        "emulate",
        "estop",
        "latency",
        "experiments",
        "signing",
        "ros2",
    )
}
"""As the entry points `kmpc.commands` of pyproject.toml; `demo` replaces that of kmpc_lite."""
