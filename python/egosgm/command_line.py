# SPDX-License-Identifier: Apache-2.0
"""What the commands of the evaluation share: how they read arguments, and print."""
import argparse
import json
import math
import re
from typing import Any, NoReturn

from . import _egosgm


class Parser(argparse.ArgumentParser):
    def __init__(self, command: str, description: str) -> None:
        super().__init__(prog=f"egosgm {command}", usage=f"egosgm {command} [OPTIONS] [ESTIMATE] [TRUTH]", description=description, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise _egosgm.InvalidArgument(f"{message}: see `{self.prog} --help`")


def add_comparison(parser: Parser, estimate_help: str, truth_help: str) -> None:
    """COMMAND ESTIMATE TRUTH, or --estimate and --truth, or one of each kind; and --frames."""
    parser.add_argument("positional", nargs="*", metavar="ESTIMATE, TRUTH", help="what --estimate and --truth take")
    parser.add_argument("--estimate", default="", metavar="FILE|DIR", help=estimate_help)
    parser.add_argument("--truth", default="", metavar="FILE|DIR", help=truth_help)
    parser.add_argument("--frames", default="", metavar="FIRST:LAST", help="only these frame numbers, both ends included: 7:10, 7:, :10 or 7")


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
    return json.dumps(plain(value), indent=2, ensure_ascii=False)
