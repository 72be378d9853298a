# SPDX-License-Identifier: Apache-2.0
"""The command `egosgm` of a wheel: the program, and what only Python reads."""
import os
import pathlib
import sys


def main() -> None:
    arguments = sys.argv[1:]
    if arguments[:1] == ["run"] and any(a.split("=")[0] == "--bag" for a in arguments):
        from . import bag_program
        sys.exit(bag_program.main(arguments[1:]))
    program = pathlib.Path(__file__).with_name("bin") / "egosgm"
    if not program.exists():
        sys.exit(f"egosgm: error: {program}: no such file: this package came without the program; it is the wheel that has it")
    os.execv(program, ["egosgm", *arguments])


if __name__ == "__main__":
    main()
