# SPDX-License-Identifier: Apache-2.0
"""The program `egosgm` of a wheel."""
import os
import pathlib
import sys


def main() -> None:
    program = pathlib.Path(__file__).with_name("bin") / "egosgm"
    if not program.exists():
        sys.exit(f"egosgm: error: {program}: no such file: this package came without the program; it is the wheel that has it")
    os.execv(program, ["egosgm", *sys.argv[1:]])


if __name__ == "__main__":
    main()
