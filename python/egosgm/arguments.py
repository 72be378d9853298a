# SPDX-License-Identifier: Apache-2.0
"""What the tools in Python share: arguments, JSON, new files, numbers in words. Errors are InvalidArgument and IoError."""
import argparse
import contextlib
import json
import math
import os
import pathlib
import re
import signal
import sys
import threading
from typing import Any, Callable, NoReturn

from . import _egosgm


class Parser(argparse.ArgumentParser):
    def __init__(self, command: str, **options: Any) -> None:
        super().__init__(prog=f"egosgm {command}", allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **options)

    def error(self, message: str) -> NoReturn:
        raise _egosgm.InvalidArgument(f"{message}: see `{self.prog} --help`")

    def print_help(self, file: Any = None) -> None:
        tell(self.format_help().rstrip())

    def parse(self, arguments: Any) -> argparse.Namespace:
        """The values. An empty one is refused, as it is a variable of the shell that was not set."""
        for before, word in zip(["", *arguments], arguments):
            name = word[:-1] if word[:-1] in self._option_string_actions else before if before in self._option_string_actions else "an argument"
            if word == "" or word == name + "=":
                raise _egosgm.InvalidArgument(f'{name} "": is empty: give a value, or leave it out')
        given, unknown = self.parse_known_intermixed_args(arguments)
        if unknown:
            name = unknown[0].split("=")[0]
            kind = "unknown option" if name.startswith("-") else "unexpected argument"
            if pathlib.Path(name).suffix and pathlib.Path(name).is_file():
                self.error(f'{kind} "{name}", a file: did the shell expand a pattern? quote it: \'*.png\''
                           + ("; images are given as --left LEFT --right RIGHT" if "--left" in self._option_string_actions else ""))
            self.error(f'{kind} "{name}"')
        return given


def text_argument(text: str) -> bytes:
    """For the library, which says what is wrong of a text that is no UTF-8."""
    return os.fsencode(text)


def say(text: str) -> None:
    """On the standard error, which may be full or closed; on one line, whatever a name in it holds."""
    if sys.stderr is None:  # which print takes for the standard output
        return
    with contextlib.suppress(OSError, AttributeError):
        print("egosgm: " + "".join(c if c.isprintable() else " " for c in text), file=sys.stderr, flush=True)


def tell(text: str, end: str = "\n") -> None:
    """On the standard output. A reader that goes has read enough."""
    try:
        print(text, end=end, flush=True)
    except BrokenPipeError:
        pass
    except OSError as error:
        raise _egosgm.IoError(f"the standard output cannot be written: {error.strerror}") from None


def on_interrupt(act: Callable[[], Any]) -> None:
    """Signals that end a program call `act` instead; those that are ignored, as under nohup, stay so."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if threading.current_thread() is threading.main_thread() and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: act())


def whole_number(text: str) -> int:
    if not re.fullmatch(r"-?(0|[1-9][0-9]*)", text):
        raise argparse.ArgumentTypeError(f'"{text}": write a decimal number without blanks, plus or leading zeros')
    return int(text)


def read_json(file: pathlib.Path) -> Any:
    return json.loads(_egosgm._read_json(file))


def left_of_run(folder: pathlib.Path, name: str, recorded: str) -> str:
    """A frame's left image: where it lay when the run was made, else the one that the run wrote, whose folder may be another one now."""
    own = folder / "left" / f"{name}.png"
    return os.fspath(own) if own.exists() and not os.path.exists(recorded) else recorded


def comparison_parser(command: str, description: str, estimate_help: str, truth_help: str) -> Parser:
    """COMMAND ESTIMATE TRUTH, or --estimate and --truth, or one of each kind; and --frames."""
    parser = Parser(command, usage=f"egosgm {command} [OPTIONS] [ESTIMATE] [TRUTH]", description=description)
    parser.add_argument("positional", nargs="*", metavar="ESTIMATE, TRUTH", help="what --estimate and --truth take")
    parser.add_argument("--estimate", default="", metavar="FILE|DIR", help=estimate_help)
    parser.add_argument("--truth", default="", metavar="FILE|DIR", help=truth_help)
    parser.add_argument("--frames", default="", metavar="FIRST:LAST", help="only these frame numbers, both ends included: 7:10, 7:, :10 or 7")
    return parser


def resolve_comparison(given: argparse.Namespace, truth_is_needed: bool = True) -> None:
    """Fills `estimate` and `truth` from the positional arguments. Throws InvalidArgument unless both are given once."""
    for argument in given.positional:
        if given.estimate and given.truth:
            raise _egosgm.InvalidArgument(f'unexpected argument "{argument}": --estimate and --truth are given already')
        setattr(given, "truth" if given.estimate else "estimate", argument)
    for name in ("estimate", "truth"):
        if not getattr(given, name) and (name == "estimate" or truth_is_needed):
            raise _egosgm.InvalidArgument(f"no {name}: give ESTIMATE TRUTH, or --estimate and --truth")


def decimal(text: str) -> float:
    """A finite number, for argparse. Python also takes 1_000, 010 and nan."""
    if not re.fullmatch(r"-?(0|[1-9][0-9]*)?(\.[0-9]*)?([eE][-+]?[0-9]+)?", text) or not math.isfinite(float(text)):
        raise ValueError(text)
    return float(text)


def counted(number: int, thing: str) -> str:
    """1 pair, 2 pairs."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def json_text(value: Any) -> str:
    """NaN becomes null."""
    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(part) for name, part in value.items()}
        if isinstance(value, (list, tuple)):
            return [plain(part) for part in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value
    return json.dumps(plain(value), indent=2, ensure_ascii=False).encode(errors="replace").decode()
