# SPDX-License-Identifier: Apache-2.0
"""egosgm report: the page's structure, and the page in a headless Chromium. Environment as for program_case.py."""
import base64
import html.parser
import json
import os
import pathlib
import re
import shutil
import unittest

from browser import CHROMIUM, Browser
from program_case import FRAMES, HEIGHT, WIDTH, ProgramTest, grey_png

LAYERS = ["left image", "disparity", "variance", "disparities searched", "reason", "error [px]"]


class Elements(html.parser.HTMLParser):
    """What a page is made of: its elements with their attributes, and the text of the one whose id is `data`."""

    def __init__(self, page):
        super().__init__()
        self.elements, self.data = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_data(self, data):
        if self.elements and self.elements[-1][1].get("id") == "data":
            self.data += data


class ReportTest(ProgramTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.out = cls.folder / "out"
        cls.works("run", "--odometry", cls.street, "--out", cls.out, "--write", "variance,search,reason", "--quiet", "--set", "p2=150",
                  "--disparities", 64)
        cls.works("report", cls.out, "--truth", cls.street / "truth/left_disp_noc", "--poses", cls.street / "poses.txt")
        cls.page = cls.out / "report.html"

    @classmethod
    def works(cls, *arguments):
        return ProgramTest.assert_works(cls("id"), *arguments)

    def copy_of_the_run(self):
        """Without its page."""
        copy = self.new_folder() / "copy"
        shutil.copytree(self.out, copy, ignore=shutil.ignore_patterns("report.html"))
        return copy

    def data(self, page):
        return json.loads(Elements(page.read_text()).data)


class Report(ReportTest):
    def test_the_page_names_no_folder_of_this_machine(self):
        self.assertNotIn(str(self.folder), self.page.read_text())
        self.assertEqual(self.data(self.page)["run"]["frames"][0]["left"], "image_0/000000.png")
        out = self.ran(*self.patterns(), "--disparities", 64, "--poses", self.street / "poses.txt")
        self.works("report", out)
        self.assertNotIn(str(self.folder), (out / "report.html").read_text())

    def test_json_that_is_nested_too_deep_or_has_too_many_keys_is_one_line(self):
        out = self.copy_of_the_run()
        report = out / "report.json"
        text = report.read_text().rstrip().removesuffix("}")
        resume = ["run", "--odometry", self.street, "--out", out, "--resume", "--quiet", "--set", "p2=150", "--disparities", 64]
        for extra, named in (("[" * 64 + "]" * 64, "nested deeper than 64"), ('{"a":' * 200_000 + "1" + "}" * 200_000, "nested deeper than 64"),
                             ("{" + ",".join(f'"k{i}": 0' for i in range(200_000)) + "}", "more than 2000 keys")):
            report.write_text(f'{text}, "x": {extra}}}')
            self.assert_all_refused(((command, "report.json", named) for command in (["report", out], resume)))
        report.write_text(text + ', "x": ' + "[" * 60 + "]" * 60 + "}")
        self.works("report", out)

    def test_the_page_holds_what_it_shows_and_asks_for_nothing_else(self):
        elements = Elements(self.page.read_text()).elements
        for tag, attributes in elements:
            self.assertNotIn(tag, ("link", "iframe", "object", "embed", "base"))
            self.assertFalse({"src", "href", "srcset", "onload"} & set(attributes), (tag, attributes))
        policy = next(attributes["content"] for tag, attributes in elements if attributes.get("http-equiv") == "Content-Security-Policy")
        self.assertTrue(policy.startswith("default-src 'none'; img-src data:;"))

    def test_frames_chooses_and_the_truth_stands_behind_the_run(self):
        page = self.new_folder() / "some.html"
        self.works("report", self.out, self.street, "--frames", "1:2", "--poses", self.street / "poses.txt", "--out", page)
        some, whole = self.data(page), self.data(self.page)
        self.assertEqual(some["run"]["frames"], whole["run"]["frames"][1:3])
        self.assertEqual([picture["frame"] for picture in some["pictures"]], [1, 2])
        self.assertEqual(some["metrics"], {number: whole["metrics"][number] for number in ("1", "2")})
        self.assertEqual(some["pooled"], self.json_of("eval", self.out, self.street / "truth/left_disp_noc", "--frames", "1:2")["pooled"])
        self.assertEqual((len(some["path"]), len(some["true_path"])), (2, 2))
        step = [[b - a for a, b in zip(*data["path"][first:first + 2])] for data, first in ((some, 0), (whole, 1))]
        for mine, own in zip(*step):  # each is seen from its first camera, which turns little
            self.assertAlmostEqual(mine, own, delta=0.05)

    def test_what_moves_is_a_layer(self):
        street = self.new_folder() / "street"
        self.assert_works("synth", "--out", street, "--frames", 3, "--width", 480, "--height", 180, "--seed", 3, "--moving-object", "--quiet")
        out = self.ran(street, "--poses", street / "poses.txt", "--write", "objects", "--disparities", 64)
        self.assert_works("report", out)
        pictures = self.data(out / "report.html")["pictures"]
        self.assertEqual([[layer["name"] for layer in picture["layers"]] for picture in pictures],
                         [["left image", "disparity", "what moves"]] * 2 + [["left image", "disparity"]])
        shown = pictures[1]["layers"]
        self.assertNotEqual(shown[0]["picture"], shown[2]["picture"])

        with open(out / "objects.csv", "a") as table:
            table.write("000001,one\n")
        (out / "report.html").unlink()
        self.assert_refused(["report", out], "objects.csv: is damaged")

    def test_pictures_of_all_layers(self):
        data = self.data(self.page)
        self.assertEqual([picture["frame"] for picture in data["pictures"]], list(range(FRAMES)))  # fewer than six
        for picture in data["pictures"]:
            self.assertEqual([layer["name"] for layer in picture["layers"]], LAYERS)
            for layer in picture["layers"]:
                kind, content = layer["picture"].split(";base64,")
                start = base64.b64decode(content, validate=True)[:8]
                self.assertTrue(start == b"\x89PNG\r\n\x1a\n" if kind == "data:image/png" else start.startswith(b"\xff\xd8\xff"), kind)
        self.assertEqual(sorted(data["bars"]), sorted(LAYERS[1:]))

    def test_figures_are_those_of_the_run_and_of_eval(self):
        data = self.data(self.page)
        run = self.report(self.out)
        for frame in run["frames"]:
            frame["left"] = "/".join(pathlib.Path(frame["left"]).parts[-2:])
        self.assertEqual(data["run"], run)
        own = self.json_of("eval", self.out, self.street / "truth/left_disp_noc")
        self.assertEqual(data["pooled"], own["pooled"])
        self.assertEqual([data["metrics"][str(i)]["bad_or_missing"] for i in range(FRAMES)], [pair["bad_or_missing"] for pair in own["pairs"]])
        self.assertEqual(sorted(data["changed"]), ["disparities", "p2"])
        self.assertEqual((len(data["path"]), len(data["true_path"])), (FRAMES, FRAMES))
        self.assertAlmostEqual(data["path"][-1][1], data["true_path"][-1][1], delta=0.2)

    def test_chosen_frames_and_where_the_page_goes(self):
        page = self.new_folder() / "page.html"
        self.assert_works("report", self.out / "report.json", "--pictures", "3,000001", "--picture-width", 100, "--out", page)
        data = self.data(page)
        self.assertEqual([picture["frame"] for picture in data["pictures"]], [1, 3])
        self.assertEqual([layer["name"] for layer in data["pictures"][0]["layers"]], LAYERS[:-1])
        self.assertIn("report OUT TRUTH", data["notes"][0])
        self.assertLess(page.stat().st_size, self.page.stat().st_size / 2)

    def test_the_page_is_the_same_in_a_locale_of_other_letters(self):
        pages = []
        for changes in ({}, dict(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")):  # both by one Python: others pack pictures in other ways
            page = self.new_folder() / "page.html"
            self.assert_works("report", self.out, "--truth", self.street / "truth/left_disp_noc", "--poses", self.street / "poses.txt", "--out", page,
                              env={**os.environ, **changes})
            pages.append(page.read_bytes())
        self.assertEqual(*pages)

    def test_truth_in_the_folders_that_eval_takes(self):
        kitti = self.new_folder() / "training"
        for folder, source in (("image_0", "image_0"), ("image_1", "image_1"), ("disp_noc", "truth/left_disp_noc")):
            (kitti / folder).mkdir(parents=True)
            for scene, frame in ((3, 2), (7, 1)):
                shutil.copy(self.street / source / f"00000{frame}.png", kitti / folder / f"00000{scene}_10.png")
        (kitti / "calib").mkdir()
        shutil.copy(self.street / "calib.txt", kitti / "calib/000007.txt")
        out = self.ran("--kitti", kitti, "--scene", 7, "--disparities", 48)
        for truth in (kitti, kitti / "disp_noc", kitti / "disp_noc/000007_10.png"):
            own, page = self.json_of("eval", out, truth), self.new_folder() / "page.html"
            self.assertEqual([pair["truth"] for pair in own["pairs"]], [str(kitti / "disp_noc/000007_10.png")])
            self.assert_works("report", out, "--truth", truth, "--out", page)
            data = self.data(page)
            self.assertEqual((list(data["metrics"]), [note[:13] for note in data["notes"]].count("Compared with")), (["10"], 1))
            self.assertAlmostEqual(data["metrics"]["10"]["bad_or_missing"], own["pooled"]["bad_or_missing"])
        (kitti / "disp_noc/000007_10.png").unlink()
        for command in (["eval", "--estimate", out], ["report", out]):
            self.assert_refused([*command, "--truth", kitti], "000010.png is of the image 000007_10")
        self.assert_works("report", self.out, "--truth", self.street, "--out", page.parent / "whole.html")
        self.assertEqual(len(self.data(page.parent / "whole.html")["metrics"]), FRAMES)

    def test_a_run_of_which_little_is_left(self):
        copy = self.copy_of_the_run()
        for folder in ("variance", "search"):
            shutil.rmtree(copy / folder)
        report = self.report(copy)
        report["input"] = "</script><script>alert(1)"
        for frame in report["frames"]:
            frame["left"] = "/nonexistent/left.png"
        (copy / "report.json").write_text(json.dumps(report))
        (copy / "poses.txt").unlink()
        self.assert_works("report", copy)
        data = self.data(copy / "report.html")
        self.assertEqual(data["run"]["input"], report["input"])
        self.assertEqual(data["pictures"][0]["layers"][0]["name"], "disparity")
        self.assertEqual(len(data["notes"]), 4)
        shutil.copytree(self.street / "image_0", copy / "left")  # as a run of a bag writes them, before its folder is moved
        (copy / "report.html").unlink()
        self.assert_works("report", copy)
        data = self.data(copy / "report.html")
        self.assertEqual((data["pictures"][0]["layers"][0]["name"], len(data["notes"])), ("left image", 3))

    def test_what_was_changed_after_the_run_is_not_shown(self):
        copy = self.copy_of_the_run()
        (copy / "poses.txt").write_text("".join((copy / "poses.txt").read_text().splitlines(True)[1:]))
        report = self.report(copy)
        for frame in report["frames"]:
            frame["left"] = str(copy / "disparity/other.png")
        (copy / "report.json").write_text(json.dumps(report))
        (copy / "disparity/other.png").write_bytes(grey_png(64, 48))
        self.assert_works("report", copy, "--pictures", 0)
        data = self.data(copy / "report.html")
        self.assertEqual((data["path"], [layer["name"] for layer in data["pictures"][0]["layers"]][0]), ([], "disparity"))
        self.assertIn(f"poses.txt has {FRAMES - 1} poses and report.json {FRAMES} frames", " ".join(data["notes"]))
        self.assertIn("other.png is 64x48 while the run's images were", " ".join(data["notes"]))

    def test_what_is_no_run_is_refused(self):
        copy = self.copy_of_the_run()
        report = self.report(copy)
        self.assert_refused(["report", self.street], "report.json", "egosgm run")
        self.assert_all_refused((
            ("--pictures 0,17", '"17"', "from 0 to 3"), ("--picture-width 1", "--picture-width 1"), ("--truth {street}/image_0/calib", "image_0/calib"),
            (f"--frames {FRAMES}:", f"--frames {FRAMES}:", f"from 0 to {FRAMES - 1}"), ("--frames some", "FIRST:LAST"),
            ("--frames 1:2 --pictures 3", "--pictures", "from 1 to 2")), ["report", self.out, "--out", self.folder / "never"])
        for text in ("[]", {**report, "frames": []}, {**report, "frames": [7]}, {**report, "options": 3}, "", "{", json.dumps(report)[:-9],
                     json.dumps(report).replace('"density": 0', '"density": 1e400')):
            (copy / "report.json").write_text(text if isinstance(text, str) else json.dumps(text))
            self.assert_refused(["report", copy], copy / "report.json", "is no JSON" if isinstance(text, str) and text != "[]" else "")
        (copy / "report.json").write_text(json.dumps(report))
        (copy / "disparity/000003.png").unlink()
        self.assert_refused(["report", copy], "disparity/000003.png")


@unittest.skipUnless(CHROMIUM, "no Chromium")
class ReportInBrowser(ReportTest):
    def setUp(self):
        self.browser = Browser()
        self.addCleanup(self.browser.close)

    def assert_no_errors(self):
        self.assertEqual(self.browser.errors(), [])
        self.assertEqual({url.split(":")[0] for url in self.browser.requests()} - {"file", "data"}, set())

    def place_of_the_stage(self):
        """Its left, top, width and height, in view."""
        return self.browser.evaluate("(() => { document.getElementById('stage').scrollIntoView(); "
                                     "const b = document.getElementById('stage').getBoundingClientRect(); return [b.x, b.y, b.width, b.height] })()")

    def test_charts_slider_and_layers(self):
        browser = self.browser
        browser.open(self.page)
        self.assertIn("street", browser.evaluate("document.title"))
        self.assertEqual(browser.evaluate("document.querySelectorAll('.chart h3').length"), 7)
        for series in browser.evaluate("[...document.querySelectorAll('.chart')].map(e => [...e.querySelectorAll('.series')].map(s => s.getTotalLength()))"):
            self.assertTrue(series and all(length > 50 for length in series), series)
        self.assertEqual(browser.evaluate("document.querySelectorAll('#options tr').length"), 19)
        self.assertEqual(sorted(browser.evaluate("[...document.querySelectorAll('.changed td:first-child')].map(e => e.textContent)")), ["disparities", "p2"])

        loaded = "(async () => { for (const id of ['above', 'below']) await document.getElementById(id).decode(); " \
                 "return ['above', 'below'].map(id => document.getElementById(id).naturalWidth) })()"
        self.assertEqual(browser.evaluate(loaded), [WIDTH, WIDTH])
        box = self.place_of_the_stage()
        self.assertAlmostEqual(box[3] / box[2], HEIGHT / WIDTH, delta=0.01)
        split = lambda: (browser.evaluate("document.getElementById('split').value"), browser.evaluate("document.getElementById('above').style.clipPath"))
        self.assertEqual(split(), ("50", "inset(0px 50% 0px 0px)"))
        middle = box[1] + box[3] / 2
        browser.mouse("mousePressed", box[0] + 0.5 * box[2], middle)
        browser.mouse("mouseMoved", box[0] + 0.25 * box[2], middle)
        browser.mouse("mouseReleased", box[0] + 0.25 * box[2], middle, buttons=0)
        self.assertEqual(split(), ("25", "inset(0px 75% 0px 0px)"))

        sources = lambda: browser.evaluate("['above', 'below'].map(id => document.getElementById(id).src)")
        pictures = self.data(self.page)["pictures"]
        self.assertEqual(sources(), [pictures[-1]["layers"][i]["picture"] for i in (0, 1)])  # opens on the last one
        for i, name in enumerate(LAYERS):
            browser.evaluate(f"{{ const s = document.getElementById('right-layer'); s.value = {json.dumps(name)}; s.dispatchEvent(new Event('change')) }}")
            self.assertEqual(sources()[1], pictures[-1]["layers"][i]["picture"])
        browser.evaluate("{ const f = document.getElementById('frame'); f.value = 2; f.dispatchEvent(new Event('input')) }")
        self.assertEqual(sources(), [pictures[2]["layers"][i]["picture"] for i in (0, len(LAYERS) - 1)])
        self.assertEqual(browser.evaluate("document.getElementById('frame-name').textContent"), "000002")
        self.assert_no_errors()

    def test_the_mouse_tells_what_the_maps_say(self):
        try:
            import cv2
        except ImportError:
            self.skipTest("no OpenCV for Python, which reads the maps here")
        self.browser.open(self.page)
        name, run = f"{FRAMES - 1:06d}", self.report(self.out)
        maps = {kind: cv2.imread(str(next((self.out / kind).glob(name + ".*"))), cv2.IMREAD_UNCHANGED) for kind in ("disparity", "variance", "reason")}
        box = self.place_of_the_stage()
        places = [(10 + 30 * i, 5 + 9 * i) for i in range(10)]
        places.append(next((x, y) for y in range(HEIGHT) for x in range(WIDTH) if not maps["disparity"][y, x]))
        camera, reasons = run["calibration"], run["reasons"]
        for x, y in places:
            reading = ""
            while not reading.startswith("x "):  # the maps are unpacked meanwhile
                self.browser.mouse("mouseMoved", box[0] + (x + 0.5) / WIDTH * box[2], box[1] + (y + 0.5) / HEIGHT * box[3], buttons=0)
                reading = self.browser.evaluate("document.getElementById('reading').textContent")
            while not reading.startswith(f"x {x}, y {y};"):
                reading = self.browser.evaluate("document.getElementById('reading').textContent")
            self.assertTrue(reading.endswith("; reason: " + reasons[maps["reason"][y, x]]), reading)
            disparity = maps["disparity"][y, x] / 256
            if not disparity:
                self.assertIn("; no disparity;", reading)
                continue
            found = [float(number) for number in re.findall(r"[\d.e+-]+(?= |$)", reading.split("disparity")[1])]
            depth, sigma = camera["fx"] * camera["baseline_m"] / disparity, maps["variance"][y, x] ** 0.5
            for value, expected, near in zip(found, (disparity, sigma, depth, depth * sigma / disparity), (0.002, 0.1, 0.002, 0.1), strict=True):
                self.assertAlmostEqual(value / expected, 1, delta=near, msg=reading)
        self.assert_no_errors()

    def test_a_warning_and_its_remedy_stand_apart(self):
        out = self.copy_of_the_run()
        report = self.report(out)
        report["warning"] = "density 24 % in the mean, 62 % of the image is nearer than the range (--disparities 128), the principal point is far (cx 1, cy 2) (scale fx, fy), a baseline of 3 m (few are wider, and is it in decimetres (0.3 m)?); poses in another order"
        report["notes"] = ["1 left image has no partner"]
        (out / "report.json").write_text(json.dumps(report))
        self.assert_works("report", out)
        self.assertEqual(self.data(out / "report.html")["warnings"], [
            {"what": "density 24 % in the mean", "remedy": "`egosgm doctor` tells why"},
            {"what": "62 % of the image is nearer than the range", "remedy": "run it with --disparities 128"},
            {"what": "the principal point is far (cx 1, cy 2)", "remedy": "scale fx, fy"},
            {"what": "a baseline of 3 m", "remedy": "few are wider, and is it in decimetres (0.3 m)?"},
            {"what": "poses in another order", "remedy": "`egosgm doctor` tells why"}])
        self.assertEqual(self.data(out / "report.html")["notes"][0], "1 left image has no partner")
        self.browser.open(out / "report.html")
        self.assertEqual(self.browser.evaluate("document.querySelectorAll('#notes .note')[1].textContent"),
                         "62 % of the image is nearer than the rangeRemedy: run it with --disparities 128")
        self.assert_no_errors()

    def test_a_short_run_without_truth(self):
        out = self.ran(self.street, "--frames", "1", "--disparities", 64)
        self.assert_works("report", out)
        self.browser.open(out / "report.html")
        self.assertEqual(self.browser.evaluate("document.querySelectorAll('.note').length"), 3)
        self.assertGreaterEqual(self.browser.evaluate("document.querySelectorAll('.chart').length"), 4)
        self.assert_no_errors()

    def test_errors_would_be_seen(self):
        broken = self.new_folder() / "broken.html"
        broken.write_text(self.page.read_text().replace("setUpPictures();\n", "setUpPicture();\n").replace("</h1>", "</h1><img src='https://localhost:1/a.png'>"))
        self.browser.open(broken)
        while not all(text in json.dumps(self.browser.errors()) for text in ("setUpPicture is not defined", "Content Security Policy")):
            self.browser.evaluate("1")  # ctest ends it where they never come
