# SPDX-License-Identifier: Apache-2.0
"""Places without evidence: sky, plain walls and ground, texture that repeats, thin poles. What a video's map has there that a single frame's has
not, and how much of it is right, by `egosgm run` and `egosgm eval-video`."""
import json
import shutil
import statistics

from inputs import SINGLE_FRAME, Missing, expect, measured, told

FIGURES = ("gained_percent", "gained_right_percent", "lost_right_percent", "wrong_of_trusted_percent", "trusted_of_wrong_percent")
HEADINGS = ["place", "filled, first frame", "filled, last frame", "filled, single frame", "bad of valid, first frame", "bad of valid, last frame",
            "bad of valid, single frame", "wrong of all, last frame", "wrong of all, single frame", "gained", "gained, right", "lost, right",
            "wrong of trusted", "trusted of wrong", "bad of valid / single frame's"]
PAPER, PAPER_PLACES = ("--preset", "paper"), ("sky", "corridor", "fence")
PLAIN = ("--plain", "--frames", 10, "--height", 480, "--noise", 2, "--pole-width", 5)
TIMES = 10  # that one pair is given
STANDING, STANDING_NOISE, HAND_PX = {"warehouse": "forest", "kitchen": "warehouse"}, 2, 220  # what covers comes from the other video; [grey levels], [px]
POLE_WIDTHS = {1: 3, 2: 4, 3: 6, 4: 8, 5: 14}  # [px], by the numbers in ids.npz
POLE_PX = 2  # an error up to this: the pole is found


class Place:
    """A sequence, and a folder of true disparities named as its frames; None where there is no truth."""

    def __init__(self, title, folder, truth, run_arguments=()):
        self.title, self.folder, self.truth = title, folder, truth
        self.run_arguments = (folder, *run_arguments)
        self.name = "".join(c if c.isalnum() else "_" for c in title)


def numpy():
    try:
        import numpy
    except ImportError as reason:
        raise Missing(f"{reason}: truth.npz needs NumPy") from None
    return numpy


def planes(bench, name):
    """A folder of planes: truth.npz has an array a frame, in which 0 says that nothing is there."""
    np, folder = numpy(), expect(bench.data / "evidence" / name)
    truth = bench.work / "evidence" / f"truth_{name}"
    truth.mkdir(parents=True, exist_ok=True)
    with np.load(folder / "truth.npz") as maps:
        for k in range(len(maps.files)):
            disparity = maps[f"arr_{k}"].astype(np.float32)
            np.save(truth / f"{k:06d}.npy", np.where(disparity == 0, np.float32(1 / 256), disparity))
    return Place(name, folder, truth)


def plain_street(bench, seed, walking=False):
    folder = bench.street(f"synthetic_plain_{seed}{'_walking' if walking else ''}", *PLAIN, "--seed", seed, *(["--moving-object"] if walking else []))
    return Place(f"plain street, seed {seed}{', people walk' if walking else ''}", folder, folder / "truth/left_disp_occ", ("--poses", folder / "poses.txt"))


def rendered(bench, name):
    folder = expect(bench.data / "rendered" / name)
    return Place(f"rendered {name}", folder, folder / "truth/left_disp_noc")


def places_of(bench):
    """Openers by title: what is missing is told row by row."""
    openers = {f"plain street, seed {seed}": lambda s=seed: plain_street(bench, s) for seed in (1, 2)}
    openers["plain street, seed 1, people walk"] = lambda: plain_street(bench, 1, True)
    openers.update({name: lambda n=name: planes(bench, n) for name in ("sky", "corridor", "fence", "poles")})
    openers.update({f"rendered {name}": lambda n=name: rendered(bench, n) for name in ("warehouse", "forest", "kitchen")})
    return openers


def run(bench, place, arguments=()):
    """The folder of the maps, and its report."""
    out = bench.work / "evidence" / "_".join([place.name, *(word.strip("-") for word in arguments)])
    if out not in bench.results:
        shutil.rmtree(out, ignore_errors=True)
        bench.egosgm("run", *place.run_arguments, *arguments, "--out", out, "--write", "reason", "--quiet")
        bench.results[out] = True
    report = json.loads((out / "report.json").read_text())
    bench.device = report["device"]
    return out, report["frames"]


def figures_of(bench, estimate, truth, frame, *arguments):
    """Of one frame, by name."""
    found = json.loads(bench.egosgm("eval-video", "--estimate", estimate, "--truth", truth, "--frames", f"{frame}:{frame}", *arguments, "--json"))
    return {**found["regions"]["all"], **found["figures"]}


def ratio(ours, single):
    return ours / single if ours is not None and single else None


def row_of(bench, place):
    (out, frames), (alone, _) = run(bench, place), run(bench, place, SINGLE_FRAME)
    first, last = (frames[i]["frame"] for i in (0, -1))
    begin, end, single = (figures_of(bench, *arguments) for arguments in (
        (out, place.truth, first), (out, place.truth, last, "--against", alone), (alone, place.truth, last)))
    return [place.title, begin["filled"], end["filled"], single["filled"], begin["bad_of_valid"], end["bad_of_valid"], single["bad_of_valid"],
            end["wrong_of_all"], single["wrong_of_all"], *(end[name] for name in FIGURES), ratio(end["bad_of_valid"], single["bad_of_valid"])]


def with_median(rows, headings):
    """And a last row: the median of the last column, the ratios."""
    ratios = [row[-1] for row in rows if len(row) == len(headings) and row[-1] is not None]
    return rows + [["median of the ratios", *[None] * (len(headings) - 2), statistics.median(ratios)]] if ratios else rows


def ratios_of(rows, ours, single, column):
    """A table: what a column of rows [video, method, ...] has for one method, by what it has for the other."""
    headings, by_video = ["video", ours, single, "ratio"], {}
    for row in rows:
        if len(row) > column:
            by_video.setdefault(row[0], {})[row[1]] = row[column]
    found = [[video, of[ours], of[single], ratio(of[ours], of[single])] for video, of in by_video.items() if of.get(ours) is not None and of.get(single)]
    return {"headings": headings, "rows": with_median(found, headings)}


def places(bench, only):
    rows = [measured(title, lambda o=opener: row_of(bench, o())) for title, opener in places_of(bench).items() if only.search(title)]
    return {"headings": HEADINGS, "rows": with_median(rows, HEADINGS)}


def repeat(bench, place):
    """The first pair of a place as a video of its own."""
    folder = bench.work / "evidence" / f"repeated_{place.name}"
    shutil.rmtree(folder, ignore_errors=True)
    truth = folder / "truth" if place.truth else None
    for side, names in (("left", ("left", "image_0")), ("right", ("right", "image_1"))):
        source = next(place.folder / name for name in names if (place.folder / name).is_dir())
        link(sorted(source.iterdir())[0], folder / side)
    if truth:
        link(sorted(place.truth.iterdir())[0], truth)
    shutil.copy(place.folder / "calib.txt", folder)
    return Place(f"{place.title}, first pair", folder, truth)


def link(file, folder):
    folder.mkdir(parents=True)
    for k in range(TIMES):
        (folder / f"{k:06d}{file.suffix}").symlink_to(file.resolve())


def repeated_row(bench, place):
    place = repeat(bench, place)
    out, frames = run(bench, place)
    filled = [100 * frames[i]["density"] for i in (0, -1)]
    wrong = [figures_of(bench, out, place.truth, frames[i]["frame"])["bad_of_valid"] if place.truth else None for i in (0, -1)]
    return [place.title, *filled, *wrong]


def repeated(bench, only):
    """One pair gives no more evidence the tenth time than the first time."""
    openers = {title: opener for title, opener in places_of(bench).items() if title in ("plain street, seed 1", "sky", "rendered warehouse")}
    openers["web25"] = lambda: Place("web25", expect(bench.data / "evidence/web25"), None)
    rows = [measured(f"{title}, first pair", lambda o=opener: repeated_row(bench, o())) for title, opener in openers.items() if only.search(title)]
    return {"headings": ["pair", "filled, first time", f"filled, time {TIMES}", "bad of valid, first time", f"bad of valid, time {TIMES}"], "rows": rows}


def before_a_camera_that_stands(bench, name, what):
    """One pair of a rendered video with new noise in every frame. "lens covered": another texture lies over the lower left of the right view;
    "hand": it lies before both, nearer than the range. Where it hides a pixel's match, nothing is right."""
    np, egosgm = numpy(), bench.video_figures().egosgm
    source, other = (expect(bench.data / "rendered" / of) for of in (name, STANDING[name]))
    left, right = (egosgm.read_grey(sorted((source / folder).iterdir())[4]).astype(np.float32) for folder in ("image_0", "image_1"))
    disparity = egosgm.read_disparity(sorted((source / "truth/left_disp_noc").iterdir())[4])
    cover = egosgm.read_grey(sorted((other / "image_1").iterdir())[4])
    height, width = left.shape
    rows, columns = slice(height // 3, None), slice(width // 10, width // 2)
    hidden = np.zeros(left.shape, bool)
    if what != "nothing":
        right[rows, columns] = cover[rows, columns]
        match = np.rint(np.arange(width) - disparity).astype(int)
        hidden[rows] = (disparity[rows] > 0) & (match[rows] >= columns.start) & (match[rows] < columns.stop)
    if what == "hand":
        shown = slice(columns.start + HAND_PX, columns.stop + HAND_PX)
        left[rows, shown] = cover[rows, columns]
        hidden[rows, shown] = True
    folder = bench.work / "evidence" / f"standing_{name}_{what}".replace(" ", "_")
    shutil.rmtree(folder, ignore_errors=True)
    for side in ("left", "right", "truth"):
        (folder / side).mkdir(parents=True)
    shutil.copy(source / "calib.txt", folder)
    random = np.random.default_rng(1)
    truth = np.where(hidden, np.float32(1 / 256), np.where(disparity > 0, disparity, np.float32(0)))
    for k in range(TIMES):
        for side, image in (("left", left), ("right", right)):
            noisy = np.clip(image + STANDING_NOISE * random.standard_normal(image.shape), 0, 255)
            egosgm.write_disparity(folder / side / f"{k:06d}.png", noisy.astype(np.float32))  # 16 bits: grey levels in 256ths
        np.save(folder / f"truth/{k:06d}.npy", truth)
    return Place(f"{name}, {what}", folder, folder / "truth", ("--disparities", 128))


def standing_row(bench, place):
    (out, frames), (alone, _) = run(bench, place), run(bench, place, SINGLE_FRAME)
    first, last = (frames[i]["frame"] for i in (0, -1))
    figures = [figures_of(bench, folder, place.truth, frame) for folder, frame in ((out, first), (out, last), (alone, last))]
    return [place.title, *(of[name] for name in ("filled", "wrong_of_all") for of in figures)]


def standing(bench, only):
    """A camera that stands sees the same mismatches in every frame."""
    titles = [(name, what) for name in STANDING for what in ("nothing", "lens covered", "hand") if only.search(f"{name}, {what}")]
    rows = [measured(f"{name}, {what}", lambda n=name, w=what: standing_row(bench, before_a_camera_that_stands(bench, n, w))) for name, what in titles]
    return {"headings": ["before the camera", "filled, first frame", f"filled, frame {TIMES}", "filled, single frame", "wrong of all, first frame",
                         f"wrong of all, frame {TIMES}", "wrong of all, single frame"], "rows": rows}


def share_found(np, disparity, truth, where):
    """Percent of the pixels whose disparity is off by at most POLE_PX."""
    return float(100 * np.mean(np.abs(disparity - truth)[where] <= POLE_PX)) if where.any() else None


def pole_rows(bench, place):
    """Of the last frame, by the poles' widths."""
    np, read = numpy(), bench.video_figures().egosgm.read_disparity
    (out, frames), (alone, _) = run(bench, place), run(bench, place, SINGLE_FRAME)
    k, name = len(frames) - 1, f"{frames[-1]['frame']:06d}"
    with np.load(place.folder / "truth.npz") as maps, np.load(place.folder / "ids.npz") as ids:
        truth, number = maps[f"arr_{k}"], ids[f"arr_{k}"]
    disparities = [read(folder / f"disparity/{name}.png") for folder in (out, alone)]
    return [[f"{width} px", *(share_found(np, disparity, truth, number == i) for disparity in disparities)] for i, width in POLE_WIDTHS.items()]


def poles(bench, only):
    rows = []
    if only.search("poles"):
        try:
            rows = pole_rows(bench, planes(bench, "poles"))
        except Exception as reason:
            rows = [["poles", told(reason)]]
    return {"headings": ["width of a pole", f"within {POLE_PX} px, last frame", "single frame"], "rows": rows}


def paper_row(bench, place):
    runs = (run(bench, place, PAPER + more) for more in (SINGLE_FRAME, ()))
    return [place.title, *(figures_of(bench, out, place.truth, frames[-1]["frame"])["wrong_of_all"] for out, frames in runs)]


def paper(bench, only):
    """What the paper's filter makes of places where nothing is seen."""
    rows = [measured(name, lambda n=name: paper_row(bench, planes(bench, n))) for name in PAPER_PLACES if only.search(name)]
    return {"headings": ["place", "wrong of all, single frame", "wrong of all, last frame"], "rows": rows}


def print_table(found):
    print("\n" + " | ".join(found["headings"]))
    for row in found["rows"]:
        print(" | ".join(value if isinstance(value, str) else "" if value is None else f"{value:.3g}" for value in row), flush=True)


def evidence_tables(bench, only):
    """`only`: a compiled pattern of the places' titles."""
    found = {}
    for name, measure in (("places", places), ("repeated", repeated), ("standing", standing), ("poles", poles), ("paper", paper)):
        found[name] = measure(bench, only)
        print_table(found[name])
    return found
