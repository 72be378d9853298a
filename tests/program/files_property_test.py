# SPDX-License-Identifier: Apache-2.0
"""Random commands over a folder tree: whatever they are told, what is a user's keeps its bytes and its mode."""
import collections
import os
import pathlib
import random
import shutil
import stat
import tempfile
import unittest

from program_case import egosgm, grey_png

COMMANDS = int(os.environ.get("EGOSGM_FILES_COMMANDS", 600))  # of each of the two tests; more in the lane `files`
RUNS = 24  # that may reach the device
POSES = "1 0 0 0 0 1 0 0 0 0 1 0\n"


class Tree:
    """Sequences, a user's files, links, and the outputs of earlier runs, some of them edited."""

    def __init__(self, folder, templates, rng):
        self.rng = rng
        self.root = folder / f"tree{rng.randrange(10**9)}"
        self.root.mkdir()
        for name in ("seq", "drive"):
            shutil.copytree(templates / "street", self.root / name)
        user = self.root / "user"
        for side in ("left", "right", "disparity", "variance"):
            (user / side).mkdir(parents=True)
            for i in range(3):
                (user / side / f"{i:06d}.png").write_bytes(grey_png(32, 16, frame=i))
        (user / "calib.toml").write_text("fx = 100\nfy = 100\ncx = 16\ncy = 8\nbaseline_m = 0.5\n")
        (user / "poses.txt").write_text(POSES * 3)
        (user / "config.toml").write_text("# Options of egosgm run: read back with --config.\ndisparities = 16\n")
        (user / "tuning.json").write_text('{"a device": {"tile_width": 32}}')
        (user / "report.json").write_text('{"program": "egosgm"}')
        for name in ("page.html", "path.svg", "path.png", "film.avi", "film.mp4", "trace.json", ".hidden", "settings.json", "empty"):
            (user / name).write_text("" if name == "empty" else f"the user's {name}")
        (user / "poses.txt").chmod(0o600)
        (user / "page.html").chmod(0o640)
        os.link(user / "left/000000.png", user / "hard_link.png")
        links = self.root / "links"
        links.mkdir()
        for name, target in (("seq", "../seq"), ("left", "../user/left"), ("poses.txt", "../user/poses.txt"), ("image.png", str(user / "right/000001.png")),
                             ("out", "../outs/run"), ("user", str(user)), ("loop", "loop")):
            (links / name).symlink_to(target)
        outs = self.root / "outs"
        for name in ("run", "edited", "linked"):
            shutil.copytree(templates / "run", outs / name)
        (outs / "edited/poses.txt").write_text(POSES)
        (outs / "edited/disparity/000001.png").write_bytes(grey_png(32, 16))
        shutil.rmtree(outs / "linked/disparity")
        (outs / "linked/disparity").symlink_to(user / "disparity")
        (outs / "linked/variance/000000.pfm").unlink()
        (outs / "linked/variance/000000.pfm").symlink_to(user / "left/000000.png")
        for name in outs.iterdir():
            (name / "notes.txt").write_text("mine")
            (name / "depth").mkdir()
            (name / "depth/000000.png").write_text("mine")
            (name / "variance/mine.pfm").write_text("mine")
        (outs / "empty").mkdir()
        self.sentinels = {}
        for path in self.root.rglob("*"):
            if path.is_dir() and not path.is_symlink():
                continue
            if outs in path.parents and path.name in ("report.json", "poses.txt"):  # of a run that goes on
                continue
            self.keep(path)

    def keep(self, path):
        self.sentinels[path] = (self.look(path), self.content(path))

    @staticmethod
    def look(path):
        found = path.lstat()
        return (found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_mode)

    @staticmethod
    def content(path):
        return stat.S_IMODE(path.lstat().st_mode), os.readlink(path) if path.is_symlink() else path.read_bytes()

    def lost(self):
        """The sentinels that are not as they were."""
        lost = []
        for path, (look, content) in self.sentinels.items():
            try:
                if self.look(path) != look and self.content(path) != content:
                    lost.append(path)
            except OSError:
                lost.append(path)
        return lost

    def add_a_users_file(self):
        """The user edits an output, or puts a file or a link beside it."""
        folders = [path for path in (self.root / "outs").rglob("*") if path.is_dir() and not path.is_symlink()]
        folder = self.rng.choice(folders)
        files = [path for path in folder.iterdir() if path.is_file() and path not in self.sentinels]
        if files and self.rng.random() < 0.5:
            path = self.rng.choice(files)
            path.write_bytes(path.read_bytes() + b"edited")
        else:
            path = folder / self.rng.choice(["000000.png", "000002.png", "poses.txt", "mine.txt", "000000.pfm", "report.json", "settings.json", "done.json"])
            if path.exists() or path.is_symlink():
                return
            if self.rng.random() < 0.3:
                path.symlink_to(self.root / "user/left/000000.png")
            else:
                path.write_text("mine")
        self.keep(path)


class Commands:
    """Draws commands."""

    def __init__(self, tree, rng):
        self.tree, self.rng, self.runs = tree, rng, 0

    def spelled(self, path, cwd):
        """One of the many names of a path."""
        path = str(path)
        folder, name = os.path.split(path)
        return self.rng.choice([path, os.path.relpath(path, cwd), "./" + os.path.relpath(path, cwd), path + "/", path + "/.", f"{folder}/./{name}", f"{path}/../{name}",
                                path.replace(f"{self.tree.root}/user", f"{self.tree.root}/links/user")])

    def folder(self, cwd):
        root = self.tree.root
        names = ["seq", "seq/image_0", "seq/truth", "seq/new", "drive", "user", "user/left", "user/right", "user/left/new", "links", "links/seq",
                 "links/left", "links/out", "links/loop", "links/poses.txt", "outs", "outs/run", "outs/edited", "outs/linked",
                 "outs/empty", "outs/new", "outs/run/disparity", "new/../user", "user/poses.txt", "."]
        if self.rng.random() < 0.02:
            return ""
        return self.spelled(root / self.rng.choice(names), cwd)

    def file(self, cwd, *more):
        root = self.tree.root
        names = ["seq/poses.txt", "seq/image_0/000000.png", "drive/calib.txt", "user/poses.txt", "user/left/000000.png", "user/config.toml",
                 "user/tuning.json", "user/page.html", "user/path.svg", "user/path.png", "user/trace.json", "user/hard_link.png",
                 "user/empty", "links/poses.txt", "links/image.png", "links/loop", "outs/run/poses.txt", "outs/edited/poses.txt", "outs/run/report.json",
                 "outs/run/notes.txt", "outs/run/report.html", "user", f"outs/new{self.rng.randrange(10**6)}"]
        path = root / self.rng.choice([*names, *more])
        return os.path.relpath(path, cwd) if self.rng.random() < 0.3 else path

    def sequence(self, cwd):
        root = self.tree.root
        seq = root / self.rng.choice(["seq", "drive", "links/seq"])
        user = root / self.rng.choice(["user", "links/user"])
        return self.rng.choice([["--odometry", self.spelled(seq, cwd)], ["--dataset", seq],
                                ["--left", user / "left/%06d.png", "--right", user / "right/*.png", "--calib", user / "calib.toml"],
                                ["--left", os.path.relpath(user / "left/*.png", cwd), "--right", user / "right/%06d.png", "--calib", user / "calib.toml"]])

    def maybe(self, probability, *words):
        return list(words) if self.rng.random() < probability else []

    def method(self):
        """Most commands end where they ask for a device that is not there: after all looks at files."""
        self.runs += (reaches := self.runs < RUNS and self.rng.random() < 0.15)
        return ["--disparities", 16, *([] if reaches else ["--device", "none of them"])]

    def run(self, cwd):
        root = self.tree.root
        how = self.rng.choice([[], ["--resume"]])
        return ["run", *self.sequence(cwd), "--out", self.folder(cwd), *how, *self.maybe(0.4, "--write", self.rng.choice(["variance", "color,cloud", "depth", "right"])),
                *self.maybe(0.3, "--poses", self.file(cwd)), *self.maybe(0.3, "--frames", "0:1"), *self.maybe(0.2, "--trace", self.file(cwd)),
                *self.maybe(0.2, "--save-config", self.file(cwd)), *self.maybe(0.2, "--config", root / "user/config.toml"),
                *self.maybe(0.1, "--tuning", self.file(cwd)), *self.maybe(0.1, "--programs", self.folder(cwd)), *self.method(), "--quiet"]

    def rectify(self, cwd):
        root = self.tree.root
        return ["rectify", *self.rng.choice([["--left", root / "user/left/*.png", "--right", root / "user/right/*.png"], ["--side-by-side", root / "user/left"]]),
                "--calib", root / "user/calib.toml", "--out", self.folder(cwd), "--quiet"]

    def synth(self, cwd):
        return ["synth", "--frames", 1, "--width", 16, "--height", 8, "--out", self.folder(cwd), "--quiet"]

    def odometry(self, cwd):
        return ["odometry", *self.sequence(cwd), "--frames", 0, "--out", self.file(cwd), "--quiet"]

    def eval_poses(self, cwd):
        poses = self.tree.root / "user/poses.txt"
        return ["eval-poses", "--estimate", poses, "--truth", poses, "--plot", self.file(cwd, "user/path.svg", "user/path.png", "outs/run/new.svg")]

    def report(self, cwd):
        return ["report", self.folder(cwd), *self.maybe(0.6, "--out", self.file(cwd)), "--pictures", 0]

    def tune(self, cwd):
        return ["tune", "--file", self.file(cwd), "--device", "none of them"]

    def compile(self, cwd):
        return ["compile", "--out", self.folder(cwd), *self.maybe(0.3, "--save-config", self.file(cwd)), "--device", "none of them"]

    def draw(self):
        cwd = self.tree.root / self.rng.choice([".", "seq", "user", "user/left", "outs", "links"])
        kinds = [self.run] * 6 + [self.rectify, self.synth, self.odometry, self.eval_poses, self.report, self.tune, self.compile]
        return cwd, self.rng.choice(kinds)(cwd)


class RandomCommands(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory(prefix="egosgm_files_")
        cls.folder = pathlib.Path(cls.holder.name).resolve()
        cls.templates = cls.folder / "templates"
        street = cls.templates / "street"
        method = ("--disparities", 16, "--quiet")
        for arguments in (["synth", "--out", street, "--frames", 3, "--width", 32, "--height", 16, "--quiet"],
                          ["run", "--odometry", street, "--out", cls.templates / "run", "--write", "variance", *method]):
            done = egosgm(*arguments)
            assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.holder.cleanup()

    def drive(self, seed):
        rng = random.Random(seed)
        codes, history = collections.Counter(), []
        tree = Tree(self.folder, self.templates, rng)
        commands = Commands(tree, rng)
        for i in range(COMMANDS):
            if i % 150 == 149:  # a fresh one, since runs fill the folders that are empty
                shutil.rmtree(tree.root)
                tree = commands.tree = Tree(self.folder, self.templates, rng)
            if rng.random() < 0.1:
                tree.add_a_users_file()
            cwd, command = commands.draw()
            if i % 150 in (75, 76):  # one that nothing is wrong with, and then over itself
                again = ["--resume"] if i % 150 == 76 else []
                cwd, command = tree.root, ["run", "--odometry", tree.root / "seq", "--out", tree.root / "plain", "--disparities", 16, "--quiet", *again]
            history.append(f"cd {cwd.relative_to(tree.root)} && egosgm {' '.join(map(str, command))}")
            done = egosgm(*command, cwd=cwd)
            code, errors = done.returncode, done.stderr
            codes[command[0], code] += 1
            self.assertIn(code, (0, 1, 2), f"command {i}: {history[-1]}: {errors}")
            self.assertNotIn("please report it", errors, f"command {i}: {history[-1]}")
            self.assertEqual(tree.lost(), [], f"command {i}: {history[-1]}: {code} {errors}")
        self.assertEqual(sum(codes.values()), COMMANDS)
        self.assertLessEqual({"run", "synth"}, {command for command, code in codes if code == 0}, codes)
        return codes


class RandomCommandsOne(RandomCommands):
    def test_what_is_the_users_stays(self):
        print(self.drive(1))


class RandomCommandsTwo(RandomCommands):
    def test_what_is_the_users_stays(self):
        print(self.drive(2))
