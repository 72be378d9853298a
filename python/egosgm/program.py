# SPDX-License-Identifier: Apache-2.0
"""The command `egosgm`: tools in Python (tools.json lists them), and those in C++ by the module."""
import contextlib
import importlib
import json
import os
import pathlib
import re
import signal
import sys
import threading
import traceback
from typing import Any, Optional, Sequence, Tuple

from .arguments import say

_PACKAGES = {  # what brings a module
    "cv2": "pip install opencv-python-headless, or apt install python3-opencv",
    "PIL": "pip install pillow, or apt install python3-pil",
    "matplotlib": "pip install matplotlib, or apt install python3-matplotlib",
    "rosbags": 'pip install the wheel with "[bag]" (docs/use/robots.md)',
}


def _module_of(arguments: Sequence[str]) -> Optional[str]:
    """The package's module whose main(arguments) does what is asked for; None where C++ does it."""
    tools = json.loads(pathlib.Path(__file__).with_name("tools.json").read_text())
    return tools[arguments[0]]["module"] if arguments and arguments[0] in tools else None


def _open_standard_streams() -> None:
    """A descriptor that is closed must not become a file's, which messages would go into: using it stays an error, as in the program in C++."""
    for stream in (0, 1, 2):
        try:
            os.fstat(stream)
        except OSError:
            os.open(os.devnull, os.O_WRONLY if stream == 0 else os.O_RDONLY)  # takes the lowest that is free
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", closefd=False)


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


def _lead_interrupts(handler: Any) -> None:
    """At first they end the process: modules of others lose an error that comes while they load, and Python would wait for C++ to come back."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if threading.current_thread() is threading.main_thread() and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, handler)


def _run_program(arguments: Sequence[str]) -> int:
    """A command in C++, in this process."""
    from . import _egosgm
    from .bag import program as bag_program
    return _egosgm._main([os.fsencode(argument) for argument in arguments], bag_program)


def _package_of(error: ImportError) -> str:
    """What does not load: by the error's name; without one, whose code raised it, or what a line of this package was to load."""
    if error.name:
        return error.name.partition(".")[0]
    for (frame, _), place in zip([*traceback.walk_tb(error.__traceback__)][::-1], traceback.extract_tb(error.__traceback__)[::-1]):
        package = frame.f_globals.get("__name__", "").partition(".")[0]
        if package == "egosgm":
            loaded = re.match(r"(?:import|from) (\w+)", place.line or "")
            return loaded[1] if loaded else ""
        if "importlib" not in package:
            return package
    return ""


def _lacking(command: str, error: Exception) -> str:
    """Of a package that is not there, or that lacks a library; empty of any other error."""
    package = _package_of(error) if isinstance(error, ImportError) else ""
    if package in ("", "egosgm"):
        return ""
    why = f"{sys.executable} does not find" if isinstance(error, ModuleNotFoundError) else f"does not load ({error})"
    return f"error: {command}: needs the Python module {package}, which {why}: {_PACKAGES.get(package, f'pip install {package}')}"


def _outcome(arguments: Sequence[str], module: Optional[str]) -> Tuple[int, str]:
    """A tool's exit code, and what is to be said of it."""
    from . import _egosgm
    try:
        if module is None:
            return _run_program(arguments), ""
        tool = importlib.import_module("." + module, __package__)
        _lead_interrupts(signal.default_int_handler)  # nothing unfinished is left
        return tool.main(list(arguments[1:])), ""
    except SystemExit as end:  # of --help
        return int(end.code or 0), ""
    except BrokenPipeError:
        return 0, ""
    except _egosgm.Error as error:
        return 2 if isinstance(error, _egosgm.InvalidArgument) else 1, f"error: {error}"
    except OSError as error:
        return 1, f"error: {os.fsdecode(error.filename)}: {error.strerror}: choose another one" if error.filename else f"error: {error}"
    except KeyboardInterrupt:
        return 130, "interrupted"
    except MemoryError:
        return 1, "error: out of memory: choose smaller images or fewer of them"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return 1, _lacking(arguments[0], error) or (f"error: {type(error).__name__}: {error} ({pathlib.Path(place.filename).name}:{place.lineno}; this is a defect of the program: "
                   "please report it)")


def run_tool(arguments: Sequence[str]) -> int:
    """Runs a command, and returns its exit code. Never calls the C++ program."""
    _lead_interrupts(signal.SIG_DFL)
    os.environ.setdefault("OPENCV_OPENCL_RUNTIME", "disabled")  # OpenCV would load drivers for nothing, whose compilers take interrupts for themselves
    _open_standard_streams()
    _print_any_name()
    code, told = _outcome(arguments, _module_of(arguments))
    error = _output_error()
    if error is not None and not isinstance(error, BrokenPipeError) and code in (0, 1):  # a reader that goes has read enough
        code, told = 1, f"error: the standard output cannot be written: {error.strerror}"
    if told:
        say(told)
    return code


def main() -> None:
    sys.exit(run_tool(sys.argv[1:]))


if __name__ == "__main__":
    main()
