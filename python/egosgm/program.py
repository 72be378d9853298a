# SPDX-License-Identifier: Apache-2.0
"""The command `egosgm` of a wheel: the program, and what only Python reads."""
import os
import pathlib
import subprocess
import sys
import tempfile
from typing import List, Tuple

_RAW = "rectify"  # the command that takes raw cameras; all others take rectified ones
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def _value_of(arguments: List[str], name: str) -> Tuple[int, str]:
    """Where the value of an option stands, and the value; -1 where it is not given."""
    for i, argument in enumerate(arguments):
        if argument == name and i + 1 < len(arguments):
            return i + 1, arguments[i + 1]
        if argument.startswith(name + "="):
            return i, argument[len(name) + 1:]
    return -1, ""


def _reads_itself(command: str, calib: str) -> bool:
    from . import _egosgm
    readers = [lambda: _egosgm._read_calibration(calib)]
    if command == _RAW:
        readers.append(lambda: _egosgm.read_opencv_rig(calib))
    for reader in readers:
        try:
            if reader() is not None:
                return True
        except (_egosgm.InvalidArgument, _egosgm.IoError, OSError):
            continue
    return False


def with_calibration(arguments: List[str], folder: pathlib.Path) -> List[str]:
    """The arguments with --calib in a form that the program reads, in a file of `folder`. Throws InvalidArgument."""
    from . import _egosgm, calibrations
    place, calib = _value_of(arguments, "--calib")
    if place < 0 or not calib or _reads_itself(arguments[0], calib):
        return arguments
    _, unit = _value_of(arguments, "--unit")
    found = calibrations.find(calib, _UNITS.get(unit), "--fisheye" in arguments)
    rest: List[str] = []
    if isinstance(found, calibrations.Rig) and found.rectified() is not None:
        found = found.rectified()
    if isinstance(found, _egosgm.Calibration):
        file = folder / "calib.txt"
        _egosgm.write_calibration(file, found)
    elif arguments[0] != _RAW:
        raise _egosgm.InvalidArgument(f"{calib}: is of raw images, and `egosgm {arguments[0]}` takes rectified ones: `egosgm rectify` makes them, by it")
    elif isinstance(found, calibrations.Rig):
        file = folder / "calib.json"
        file.write_text(found.text())
        rest = ["--fisheye"] if found.is_fisheye and "--fisheye" not in arguments else []
        if unit:  # it is in metres now
            arguments = [a for i, a in enumerate(arguments) if i not in (_value_of(arguments, "--unit")[0], _value_of(arguments, "--unit")[0] - 1)] \
                if "--unit" in arguments else [a for a in arguments if not a.startswith("--unit=")]
            place, _ = _value_of(arguments, "--calib")
            rest.append("--unit=m")
    else:
        return arguments
    changed = list(arguments)
    changed[place] = f"--calib={file}" if changed[place].startswith("--calib=") else str(file)
    return changed + rest


def main() -> None:
    arguments = sys.argv[1:]
    if arguments[:1] == ["run"] and any(a.split("=")[0] == "--bag" for a in arguments):
        from . import bag_program
        sys.exit(bag_program.main(arguments[1:]))
    program = pathlib.Path(__file__).with_name("bin") / "egosgm"
    if not program.exists():
        sys.exit(f"egosgm: error: {program}: no such file: this package came without the program; it is the wheel that has it")
    if not any(a.split("=")[0] == "--calib" for a in arguments):
        os.execv(program, ["egosgm", *arguments])
    from . import _egosgm
    with tempfile.TemporaryDirectory(prefix="egosgm_") as folder:
        try:
            changed = with_calibration(arguments, pathlib.Path(folder))
        except (_egosgm.InvalidArgument, _egosgm.IoError, OSError) as error:
            print(f"egosgm: error: {error}", file=sys.stderr)
            sys.exit(2)
        if changed != arguments:
            sys.exit(subprocess.call([program, *changed]))
    os.execv(program, ["egosgm", *arguments])


if __name__ == "__main__":
    main()
