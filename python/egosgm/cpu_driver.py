# SPDX-License-Identifier: Apache-2.0
"""Shows the OpenCL loader the CPU implementation of the extra "cpu", which registers itself nowhere."""
import importlib.metadata
import os
import pathlib
from typing import Optional

_REGISTERED = pathlib.Path("/etc/OpenCL/vendors")


def packaged_library() -> Optional[str]:
    """Intel's library where pip put it."""
    try:
        files = importlib.metadata.files("intel-opencl-rt") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    paths = [os.path.realpath(file.locate()) for file in files if file.name == "libintelocl.so"]
    return paths[0] if paths and os.path.exists(paths[0]) else None


def vendors_with(library: str) -> pathlib.Path:
    """A folder of the user with what is registered in the system, and the library. Throws OSError."""
    folder = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "egosgm/vendors"
    folder.mkdir(parents=True, exist_ok=True)
    texts = {file.name: os.fsdecode(file.read_bytes()) for file in _REGISTERED.glob("*.icd")}
    texts["egosgm_cpu.icd"] = library + "\n"
    for stale in folder.glob("*.icd"):
        if stale.name not in texts:
            stale.unlink(missing_ok=True)
    for name, text in texts.items():  # each appears whole, as other processes may read it
        part = folder / f"{name}.{os.getpid()}"
        part.write_bytes(os.fsencode(text))
        os.replace(part, folder / name)
    return folder


def show() -> None:
    """Beside what is registered in the system. What the user set is left as it is."""
    os.environ.setdefault("PYOPENCL_HOME", os.path.dirname(os.path.abspath(__file__)))  # the wheel's loader, which is pyopencl's, ends the process without it
    if "OCL_ICD_FILENAMES" in os.environ or "OCL_ICD_VENDORS" in os.environ:
        return
    library = packaged_library()
    if library:
        try:
            os.environ["OCL_ICD_VENDORS"] = str(vendors_with(library))
        except (OSError, RuntimeError):  # no folder that can be written
            os.environ["OCL_ICD_VENDORS"] = library
