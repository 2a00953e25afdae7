"""Compiles the contract into the wheel, from the checkout or from the copy in a source distribution."""

import tempfile
from importlib import resources
from pathlib import Path
from typing import Any

from grpc_tools import protoc
from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompileContract(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root = Path(self.root)
        copied = root / "proto"
        contract = copied if copied.is_dir() else root / "../../proto"
        editable = version == "editable"
        out = root / "src" if editable else Path(self.scratch())
        files = sorted(contract.glob("grasp/v1/*.proto"))
        well_known = resources.files("grpc_tools") / "_proto"
        arguments = [f"--proto_path={contract}", f"--proto_path={well_known}", f"--python_out={out}", f"--pyi_out={out}"]
        if not files or protoc.main(["protoc", *arguments, *map(str, files)]) != 0:
            raise RuntimeError(f"cannot compile the contract in {contract}")
        if not editable:
            build_data["force_include"][str(out / "grasp")] = "grasp"

    def scratch(self) -> str:
        self.folder = tempfile.TemporaryDirectory()
        return self.folder.name

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self.folder.cleanup()
