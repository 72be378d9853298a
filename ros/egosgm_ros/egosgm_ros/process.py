# SPDX-License-Identifier: Apache-2.0
"""What the node's process needs for large messages: Fast DDS's shared memory, and memory that glibc keeps."""
import contextlib
import ctypes
import os
import pathlib

PROFILES = pathlib.Path(__file__).with_name("fastdds.xml")
VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # before Fast DDS 3, and since then
VARIABLE = VARIABLES[os.environ.get("ROS_DISTRO") not in ("humble", "iron", "jazzy")]


def prepare() -> None:
    """Fast DDS gets shared memory for maps, unless somebody chose what it has. glibc keeps the memory of maps, which come and go with each pair;
    else the kernel clears it anew each time."""
    if not any(name in os.environ for name in (*VARIABLES, "FASTDDS_BUILTIN_TRANSPORTS")):
        os.environ[VARIABLE] = str(PROFILES)
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(-3, 32 << 20)  # M_MMAP_THRESHOLD
        mallopt(-1, 128 << 20)  # M_TRIM_THRESHOLD
