"""Hatchling build hook: generates gridwright.v1 from the .proto files.

Wheels get the generated package by force-include; an editable install finds it under build/gen,
which is one of `dev-mode-dirs`.
"""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ProtobufBuildHook(BuildHookInterface):
    """Runs protoc over proto/gridwright before anything is packed."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        out = Path(self.root, "build", "gen")
        generate(Path(self.root, "proto"), out)
        if version != "editable":
            build_data["force_include"][str(out / "gridwright")] = "gridwright"


def generate(source: Path, out: Path) -> None:
    """Writes message, service and type stub modules for every .proto under `source` into `out`."""
    # Imported here: hatchling loads this file also where the build requirements are not yet there.
    import grpc_tools
    from grpc_tools import protoc

    out.mkdir(parents=True, exist_ok=True)
    well_known_types = Path(grpc_tools.__file__).parent / "_proto"
    status = protoc.main(
        [
            "protoc",
            f"--proto_path={source}",
            f"--proto_path={well_known_types}",
            f"--python_out={out}",
            f"--mypy_out=quiet:{out}",
            f"--grpc_python_out={out}",
            f"--mypy_grpc_out=quiet:{out}",
            *(str(path) for path in sorted(source.glob("gridwright/**/*.proto"))),
        ]
    )
    if status != 0:
        raise RuntimeError(f"protoc failed with status {status}")
    (out / "gridwright" / "v1" / "py.typed").touch()
