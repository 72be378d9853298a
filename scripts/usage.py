# SPDX-License-Identifier: Apache-2.0
"""What the scripts in Python share: a parser whose --help prints the script's text, and whose errors are one line."""
import argparse
import re
import sys
from typing import Any, NoReturn


class Parser(argparse.ArgumentParser):
    def __init__(self, text: str) -> None:
        super().__init__(description=text, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)

    def parse_args(self, *arguments: Any) -> argparse.Namespace:  # type: ignore[override]
        """argparse would first name what is missing."""
        for word in sys.argv[1:]:
            if re.match("--?[A-Za-z]", word) and word.split("=")[0] not in self._option_string_actions:
                self.error(f'unknown argument "{word}"')
        return super().parse_args(*arguments)

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}: see --help\n")
