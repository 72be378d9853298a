# SPDX-License-Identifier: Apache-2.0
"""The command `egosgm`: tools in Python (tools.json lists them), and the program in C++ for all others."""
import contextlib
import importlib
import json
import os
import pathlib
import signal
import sys
import threading
from typing import List, Optional, Sequence, Tuple

from .arguments import say

_PACKAGES = {  # what brings a module
    "cv2": "pip install opencv-python-headless, or apt install python3-opencv",
    "matplotlib": "pip install matplotlib, or apt install python3-matplotlib",
    "rosbags": 'pip install the wheel with "[bag]" (docs/robots.md)',
}


def _value_of(arguments: List[str], name: str) -> Tuple[int, str]:
    """Where the value of an option stands, and the value; -1 where it is not given."""
    for i, argument in enumerate(arguments):
        if argument == name and i + 1 < len(arguments):
            return i + 1, arguments[i + 1]
        if argument.startswith(name + "="):
            return i, argument[len(name) + 1:]
    return -1, ""


def _reads_itself(calib: str) -> bool:
    from . import _egosgm
    try:
        _egosgm._read_calibration(calib)
        return True
    except (_egosgm.InvalidArgument, _egosgm.IoError, OSError):
        return False


def with_calibration(arguments: List[str]) -> List[str]:
    """The arguments with --calib in a form that the program reads, in a file of memory alone that it inherits. Throws InvalidArgument."""
    from . import _egosgm, calibrations
    place, calib = _value_of(arguments, "--calib")
    if place < 0 or not (os.path.isfile(calib) or os.path.isdir(calib)) or _reads_itself(calib):  # a pipe can be read once
        return arguments
    found = calibrations.find(calib)
    if not isinstance(found, _egosgm.Calibration):
        raise _egosgm.InvalidArgument(f"{calib}: is of raw images, and `egosgm {arguments[0]}` takes rectified ones: `egosgm rectify` makes them, by it")
    file = f"/proc/self/fd/{os.memfd_create('calib.txt', 0)}"
    _egosgm.write_calibration(file, found)
    changed = list(arguments)
    changed[place] = f"--calib={file}" if changed[place].startswith("--calib=") else file
    return changed


def _module_of(arguments: Sequence[str]) -> Optional[str]:
    """The package's module whose main(arguments) does what is asked for; None where the C++ program does it."""
    if arguments[:1] == ["run"] and any(a.split("=")[0] == "--bag" for a in arguments):
        return "bag_program"
    tools = json.loads(pathlib.Path(__file__).with_name("tools.json").read_text())
    return tools[arguments[0]]["module"] if arguments and arguments[0] in tools else None


def _print_any_name() -> None:
    """Names of files need not be text."""
    with contextlib.suppress(AttributeError):  # no standard output, or one of a test
        sys.stdout.reconfigure(errors="surrogateescape" if sys.stdout.encoding.lower() == "utf-8" else "replace")


def _output_error() -> Optional[OSError]:
    """Why the standard output does not take what was printed; None where it does."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return error
    return None


def _outcome(arguments: Sequence[str], module: str) -> Tuple[int, str]:
    """A tool's exit code, and what is to be said of it."""
    from . import _egosgm
    try:
        return importlib.import_module("." + module, __package__).main(list(arguments[1:])), ""
    except SystemExit as end:  # of --help
        return int(end.code or 0), ""
    except ModuleNotFoundError as error:
        package = error.name or ""
        if package.startswith("egosgm"):
            raise
        remedy = _PACKAGES.get(package, f"pip install {package}")
        return 1, f"error: {arguments[0]}: needs the Python module {package}, which {sys.executable} does not find: {remedy}"
    except BrokenPipeError:
        return 0, ""
    except _egosgm.Error as error:
        return 2 if isinstance(error, _egosgm.InvalidArgument) else 1, f"error: {error}"
    except OSError as error:
        return 1, f"error: {os.fsdecode(error.filename)}: {error.strerror}: choose another one" if error.filename else f"error: {error}"
    except KeyboardInterrupt:
        return 130, "interrupted"


def run_tool(arguments: Sequence[str]) -> int:
    """Runs a tool that is written in Python, and returns its exit code. Never calls the C++ program."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # as an interrupt: nothing unfinished is left
    _print_any_name()
    module = _module_of(arguments)
    if module is None:
        say(f"error: {' '.join(arguments[:1])}: this version of the Python package has no such tool: install the program's own version")
        return 1
    code, told = _outcome(arguments, module)
    error = _output_error()
    if error is not None and not isinstance(error, BrokenPipeError) and code in (0, 1):  # a reader that goes has read enough
        code, told = 1, f"error: the standard output cannot be written: {error.strerror}"
    if told:
        say(told)
    return code


def _program() -> Optional[pathlib.Path]:
    """The C++ program that came with the package, or that was built or installed beside it."""
    package = pathlib.Path(__file__).resolve().parent
    places = [package / "bin/egosgm", package.parents[1] / "apps/egosgm"]
    if package.parent.name == "dist-packages":
        places.append(package.parents[3] / "bin/egosgm")
    for place in places:
        with contextlib.suppress(OSError):
            with place.open("rb") as file:
                if file.read(4) == b"\x7fELF":  # no script, which could be this one
                    return place
    return None


def main() -> None:
    arguments = sys.argv[1:]
    if _module_of(arguments):
        sys.exit(run_tool(arguments))
    program = _program()
    if program is None:
        sys.exit("egosgm: error: the program is neither in this package nor beside it: pip install the wheel, which has it (docs/python.md)")
    from . import _egosgm
    try:
        arguments = with_calibration(arguments)
    except (_egosgm.InvalidArgument, _egosgm.IoError, OSError) as error:
        say(f"error: {error}")
        sys.exit(2 if isinstance(error, _egosgm.InvalidArgument) else 1)
    os.execv(program, ["egosgm", *arguments])


if __name__ == "__main__":
    main()
