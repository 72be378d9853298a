# SPDX-License-Identifier: Apache-2.0
"""The command `egosgm`: tools in Python (tools.json lists them), and those in C++ by the module."""
import contextlib
import importlib
import json
import os
import pathlib
import signal
import sys
import tempfile
import threading
from typing import List, Optional, Sequence, Tuple

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


def with_calibration(arguments: List[str], folder: pathlib.Path) -> List[str]:
    """The arguments with --calib in a form that the program reads, in a file of `folder`. Throws InvalidArgument."""
    from . import _egosgm, calibrations
    place, calib = _value_of(arguments, "--calib")
    if place < 0 or not calib or _reads_itself(calib):
        return arguments
    found = calibrations.find(calib)
    if not isinstance(found, _egosgm.Calibration):
        raise _egosgm.InvalidArgument(f"{calib}: is of raw images, and `egosgm {arguments[0]}` takes rectified ones: `egosgm rectify` makes them, by it")
    file = folder / "calib.txt"
    _egosgm.write_calibration(file, found)
    changed = list(arguments)
    changed[place] = f"--calib={file}" if changed[place].startswith("--calib=") else str(file)
    return changed


def _module_of(arguments: Sequence[str]) -> Optional[str]:
    """The package's module whose main(arguments) does what is asked for; None where C++ does it."""
    tools = json.loads(pathlib.Path(__file__).with_name("tools.json").read_text())
    return tools[arguments[0]]["module"] if arguments and arguments[0] in tools else None


def _say(text: str) -> None:
    """On one line, whatever a name in it holds."""
    with contextlib.suppress(OSError, AttributeError):  # the standard error may be full or closed
        print("egosgm: " + "".join(c if c.isprintable() else " " for c in text), file=sys.stderr, flush=True)


def _flushed(code: int) -> int:
    """A result that the standard output did not take is none; a reader that goes has read enough."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            _say(f"error: the standard output cannot be written: {error.strerror}")
            return 1
    return code


def _run_program(arguments: List[str]) -> int:
    """A command in C++, in this process."""
    from . import _egosgm, bag_program
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)  # Python's handlers would wait for C++ to come back
    given = {argument.split("=")[0] for argument in arguments}
    if "--calib" not in given or "--bag" in given:
        return _egosgm._main(arguments, bag_program)
    with tempfile.TemporaryDirectory(prefix="egosgm_") as folder:
        return _egosgm._main(with_calibration(arguments, pathlib.Path(folder)), bag_program)


def run_tool(arguments: Sequence[str]) -> int:
    """Runs a command, and returns its exit code. Never calls the C++ program."""
    from . import _egosgm
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # as an interrupt: nothing unfinished is left
    module = _module_of(arguments)
    try:
        if module is None:
            return _run_program(list(arguments))
        return _flushed(importlib.import_module("." + module, __package__).main(list(arguments[1:])))
    except SystemExit as end:  # of --help
        return _flushed(int(end.code or 0))
    except ModuleNotFoundError as error:
        package = error.name or ""
        if package.startswith("egosgm"):
            raise
        remedy = _PACKAGES.get(package, f"pip install {package}")
        _say(f"error: {arguments[0]}: needs the Python module {package}, which {sys.executable} does not find: {remedy}")
        return 1
    except BrokenPipeError:
        return _flushed(0)
    except (_egosgm.InvalidArgument, _egosgm.IoError, _egosgm.DeviceError, OSError) as error:
        _say(f"error: {error}")
        return 2 if isinstance(error, _egosgm.InvalidArgument) else 1
    except KeyboardInterrupt:
        _say("interrupted")
        return 130


def main() -> None:
    sys.exit(run_tool(sys.argv[1:]))


if __name__ == "__main__":
    main()
