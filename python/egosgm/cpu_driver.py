# SPDX-License-Identifier: Apache-2.0
"""Shows the OpenCL loader the CPU implementation of the extra "cpu", which registers itself nowhere."""
import importlib.metadata
import os
from typing import Optional


def packaged_library() -> Optional[str]:
    """Intel's library where pip put it."""
    try:
        files = importlib.metadata.files("intel-opencl-rt") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    paths = [os.path.realpath(file.locate()) for file in files if file.name == "libintelocl.so"]
    return paths[0] if paths and os.path.exists(paths[0]) else None


def show() -> None:
    """Beside what is registered in the system. What the user set is left as it is."""
    if "OCL_ICD_FILENAMES" in os.environ:
        return
    library = packaged_library()
    if library:
        os.environ["OCL_ICD_FILENAMES"] = library
