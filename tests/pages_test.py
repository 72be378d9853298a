# SPDX-License-Identifier: Apache-2.0
"""What the pages name is there: options, the package's extras, files. EGOSGM_PROGRAM names the program."""
import os
import pathlib
import re
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(SOURCE / "tests/program"))

from program_case import ProgramTest  # noqa: E402

PAGES = {page: page.read_text() for page in (*SOURCE.glob("*.md"), *(SOURCE / "docs").rglob("*.md")) if page.name != "CHANGELOG.md"}
FOLDERS = "apps|bench|cmake|docs|examples|host|include|kernels|python|ros|scripts|tests|vision"


def of_pages(pattern):
    """(page's name, what the pattern's groups hold), line by line."""
    for page, text in PAGES.items():
        for line in text.splitlines():
            yield from ((page.name, match) for match in re.findall(pattern, line))


class Pages(ProgramTest):
    def test_options_are_accepted(self):
        rooms = "|".join(set(re.findall(r'visit\("(\w+)\.', (SOURCE / "host/method_options.cpp").read_text())))
        given = {match for _, match in of_pages(r"--set ([\w.]+)=([\w.]+)")}
        given |= {(name, "1") for _, name in of_pages(rf"`((?:constants\.)?(?:{rooms})\.\w+)`")}
        self.assertGreater(len(given), 3)
        for name, value in sorted(given):
            self.assert_refused(["run", self.street, "--device", "no such device", "--set", f"{name}={value}", "--out", self.new_folder() / "out"],
                                "no OpenCL device fits")

    def test_options_of_commands_are_theirs(self):
        """Of each `egosgm COMMAND ... --option` in a page, also over several lines."""
        known, found = {}, 0
        for page, text in PAGES.items():
            lines = "\n".join(re.findall(r"^```(?:sh|console|bash)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)).replace("\\\n", " ").splitlines()
            for line in [*lines, *re.findall(r"`([^`\n]+)`", text)]:
                for command, rest in re.findall(r"(?:^|[\s/;(])egosgm ([a-z][a-z-]*)((?:\s[^#;|&]*)?)", line):
                    options = set(re.findall(r"(?<=\s)--[a-z][a-z-]*", rest))
                    words = (command, "--bag", "b.mcap") if "--bag" in options else (command,)
                    if words not in known:
                        known[words] = set(re.findall(r"--[a-z][a-z-]*", self.assert_works(*words, "--help")))
                    found += len(options)
                    self.assertLessEqual(options, known[words] | {"--help"}, f"{page.name}: {line}")
        self.assertGreater(found, 60)

    def test_options_alone_are_of_some_command(self):
        """`--option` in a sentence: of a command, of a script or of a bench."""
        texts = [file.read_text() for folder in ("scripts", "bench") for file in (SOURCE / folder).rglob("*")
                 if file.is_file() and file.parent.name != "__pycache__"]
        commands = re.findall(r"^  ([a-z][a-z-]+) ", self.assert_works("--help").split("Try it:")[0], re.MULTILINE)
        self.assertGreater(len(commands), 10)
        texts += [self.assert_works(*words, "--help") for words in [*([command] for command in commands), ["run", "--bag", "b.mcap"]]]
        known = {option for text in texts for option in re.findall(r"--[a-z][a-z-]*", text)}
        for page, option in of_pages(r"`(--[a-z][a-z-]*)"):
            self.assertIn(option, known, page)

    def test_what_lines_of_a_shell_run_may_be_run(self):
        lines = "\n".join(line for text in PAGES.values() for line in re.findall(r"^```(?:sh|console|bash)\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
        programs = {word for word in re.findall(rf"^((?:{FOLDERS})/[\w./-]+)", lines, re.MULTILINE) if (SOURCE / word).is_file()}
        self.assertGreater(len(programs), 5)
        for program in sorted(programs):
            self.assertTrue(os.access(SOURCE / program, os.X_OK) and (SOURCE / program).read_bytes().startswith(b"#!"), f"{program} is not executable")

    def test_extras_exist_and_are_not_asked_of_the_index(self):
        there = set(re.findall(r"^(\w+) = \[", (SOURCE / "pyproject.toml").read_text().split("[project.optional-dependencies]")[1], re.MULTILINE))
        for page, (package, extra) in of_pages(r'pip install "([\w./*-]+)\[(\w+)\]'):
            self.assertIn(extra, there, page)
            self.assertTrue(package.endswith(".whl"), f"{page}: {package} is on no index")
        self.assertEqual(list(of_pages(r'pip install (?:-\S+ )*("?egosgm)(?![\w/-])')), [])  # whose it would be, nobody knows

    def test_what_keeps_windows_out_of_the_core_is_told(self):
        files = [file for folder in ("host", "include") for file in (SOURCE / folder).rglob("*") if file.suffix in (".h", ".cpp")]
        calls = {str(file.relative_to(SOURCE)) for file in files if re.search(r"^#include <(?:dlfcn|fcntl|pthread|unistd|poll|sys/\w+)\.h>", file.read_text(), re.M)}
        attributes = {str(file.relative_to(SOURCE)) for file in files if "include" in file.parts and "__attribute__" in file.read_text()}
        text = (SOURCE / "docs/use/send-your-device.md").read_text()
        told = re.search(r"^Windows and macOS are kept out by.*?\n\n", text, re.M | re.S)[0]
        self.assertEqual(set(re.findall(r"`((?:host|include)/[\w/.]+)`", told)), calls | attributes)

    def test_files_exist(self):
        for page, name in of_pages(rf"`((?:{FOLDERS})/[\w./-]+)`"):
            if "foo" in name or re.search(r"[A-Z]{4}", name) and "README" not in name:
                continue  # for a name to choose
            self.assertTrue(os.path.lexists(SOURCE / name.rstrip("/.")), f"{page}: {name}")
        for page, text in PAGES.items():
            for name in re.findall(r"\]\(([\w./-]+)(?:#[\w-]*)?\)", text):
                self.assertTrue((page.parent / name).exists(), f"{page.name}: {name}")
