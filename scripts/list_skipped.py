# SPDX-License-Identifier: Apache-2.0
"""Prints which tests of ctest's JUnit file were skipped, and why"""
import re
import xml.etree.ElementTree

from usage import Parser

# As cmake/SkippedTest.cmake, unittest and GoogleTest say it.
REASONS = re.compile(r"^skipped: (.+)$|\.\.\. skipped ['\"](.+)['\"]$|: Skipped\n(.+)$", re.MULTILINE)


def main(file):
    skipped = [case for case in xml.etree.ElementTree.parse(file).iter("testcase") if case.find("skipped") is not None]
    if skipped:
        print(f"\n{len(skipped)} tests were skipped, as a whole or in part:")
    for case in skipped:
        found = dict.fromkeys(next(filter(None, match)) for match in REASONS.findall(case.findtext("system-out") or ""))
        print(f"  {case.get('name')}: {'; '.join(found) or 'it does not say why'}")


if __name__ == "__main__":
    parser = Parser(__doc__)
    parser.add_argument("file", metavar="FILE")
    main(parser.parse_args().file)
