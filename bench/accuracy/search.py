# SPDX-License-Identifier: Apache-2.0
"""A greedy search for better constants of the method, by the figures of many inputs at once (docs/develop/search.md)."""
import multiprocessing
import pathlib
import random
import re
import shutil
import subprocess
import time

import evidence
from ablation import FIGURES, Case, cases
from inputs import PROJECT, STEADY_FROM, Failed

INPUTS = r"^(2012 / .*|2015 / .*|warehouse|forest|kitchen|street [123](, moving)?)$"
PLACES = ("sky", "corridor", "fence", "poles")
STEP = 1.5
WEIGHTS = {"bad_or_missing": 1, "bad_of_valid": 2, "interpolated": 2, "moving_off_or_missing": 2}  # of ratios to the start's
SURFACE_PX, MOVING_PX = 1, 1.0  # a place's truth below SURFACE_PX says that nothing is there
SEARCH_WEIGHT = 0.1  # a tenth more cells cost as much as figures that are a hundredth worse
LEAST_GAIN = 0.001


def default_constants():
    """Numbers by name: host/method_options.h's as `stage.name`, kernels/method.h's as their macros."""
    text = (PROJECT / "host/method_options.h").read_text()
    stages = dict(re.findall(r"^  (\w+Options) (\w+);", text, re.MULTILINE))
    found = {}
    for struct, body in re.findall(r"struct (\w+Options) \{(.*?)\n\};", text, re.DOTALL):
        body = re.sub(r"//[^\n]*", "", body)
        for kind, line in re.findall(r"\b(int|float) ([^;()]*);", body):
            for name, value in re.findall(r"(\w+) =\s*([\d.e-]+)f?", line):
                if struct in stages:
                    found[f"{stages[struct]}.{name}"] = int(value) if kind == "int" else float(value)
    macros = re.findall(r"^#define (EGOSGM_\w+) (-?[\d.e-]+)(f?)$", (PROJECT / "kernels/method.h").read_text(), re.MULTILINE)
    return found | {name: float(value) if suffix else int(value) for name, value, suffix in macros}


def steps_from(value):
    """What is tried for a number: a step up and one down, whole numbers stay whole."""
    if isinstance(value, int):
        return [v for v in dict.fromkeys((max(round(value * STEP), value + 1), min(round(value / STEP), value - 1))) if v >= 0] if value > 0 else []
    return [float(f"{value * STEP:.2g}"), float(f"{value / STEP:.2g}")] if value > 0 else []


class Variant:
    """A copy of the checkout, whose kernels/method.h has other numbers."""

    def __init__(self, bench):
        self.bench, self.folder, self.copied = bench, bench.work / "search", False

    def copy(self):
        """The checkout as it is now. What an earlier search built stays, and is built again where files are newer."""
        for old in self.folder.glob("*"):
            if old.name != "build":
                shutil.rmtree(old) if old.is_dir() else old.unlink()
        files = subprocess.run(["git", "ls-files", "-z"], cwd=PROJECT, capture_output=True, text=True, check=True).stdout.split("\0")
        for name in filter(None, files):
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / name, self.folder / name)
        self.copied = True

    def program(self, macros):
        if not macros:
            return self.bench.egosgm.path
        if not self.copied:
            self.copy()
        text = (PROJECT / "kernels/method.h").read_text()
        for name, value in macros.items():
            text = re.sub(rf"^(#define {name}) .*", rf"\1 {value}{'f' if isinstance(value, float) else ''}", text, flags=re.MULTILINE)
        (self.folder / "kernels/method.h").write_text(text)
        done = subprocess.run([self.folder / "scripts/build", "egosgm_program", "egosgm_python"], capture_output=True, text=True)
        if done.returncode:
            raise Failed(f"scripts/build in {self.folder}: {(done.stdout + done.stderr).strip().splitlines()[-1]}")
        return self.folder / "build/apps/egosgm"


class PlaceVideo:
    """A place of the bench's evidence as a case plays it."""

    def __init__(self, figures, place):
        recorded = figures.Recorded(figures.egosgm.open_folder(place.folder))
        self.calibration, self.size, self.numbers, self.images, self.motion = (
            recorded.calibration, recorded.size, recorded.numbers, recorded.images, recorded.motion)
        self.truth = lambda k: figures.np.load(sorted(place.truth.iterdir())[list(recorded.numbers).index(k)])


def inputs_of(bench, figures, pattern):
    found = [case for case in cases(bench, pattern)[0] if re.search(pattern, case.title)]
    for name in PLACES:
        if re.search(pattern, name) or pattern == INPUTS:
            video = PlaceVideo(figures, evidence.planes(bench, name))
            found.append(Case("places", name, video, video.numbers, [list(video.numbers)[-1]]))
    return found


def sequences_of(figures, folders):
    """Recorded sequences of one's own, with truth beside some of their frames."""
    for folder in folders:
        try:
            sequence = figures.egosgm.open_folder(folder)
        except figures.egosgm.Error as reason:
            raise Failed(str(reason)) from None
        scored = [frame.number for frame in sequence.frames[STEADY_FROM:] if pathlib.Path(frame.truth_noc).is_file()]
        if not scored:
            raise Failed(f"{folder}: no truth from frame {STEADY_FROM} on")
        yield Case("own", str(folder), figures.Recorded(sequence), [frame.number for frame in sequence.frames], scored)


def counts_of(figures, case, options):
    """Pixels of the scored frames, and the mean share of cells that is searched."""
    np, egosgm = figures.np, figures.egosgm
    sums, searched = np.zeros(7), []
    for k, frame in figures.play(case.video, case.numbers, **case.disturbance, **options):
        if k not in case.scored:
            continue
        truth, disparity = case.video.truth(k), frame.disparity
        known, valid = figures.is_valid(truth), figures.is_valid(disparity)
        moving = known & case.video.moving(k) if "moving" in case.title else np.zeros_like(known)
        far = np.abs(disparity - truth)
        off_interpolated = np.abs(egosgm.interpolate_background(disparity) - truth) > figures.BAD_PX
        surface, bad = known & (truth >= SURFACE_PX), valid & (far > figures.BAD_PX)
        maps = (known, known & valid, known & bad, surface, surface & valid, known & off_interpolated, moving & ~(valid & (far <= MOVING_PX)))
        sums += [int(part.sum()) for part in maps]
        searched.append(frame.report.search_fraction)
    return sums.tolist(), float(np.mean(searched))


def figures_of(case, sums, searched):
    known, valid, bad, surface, seen, interpolated, moving = sums
    if case.kind == "places":
        return {"wrong_of_all": 100 * bad / known, "filled": 100 * seen / surface if surface else 100, "search": 100 * searched}
    found = dict(zip(FIGURES, (100 * (known - valid + bad) / known, 100 * bad / max(valid, 1), 100 * interpolated / known)))
    return found | {"search": 100 * searched, **({"moving_off_or_missing": 100 * moving / known} if moving else {})}


def evaluate(arguments, program, options):
    """(kind, title, figures by name) of every input. Runs in a process of its own, as a build's module is loaded once."""
    from inputs import Bench
    arguments.egosgm = str(program)
    bench = Bench(arguments)
    figures = bench.video_figures()
    inputs = sequences_of(figures, arguments.sequences) if arguments.sequences else inputs_of(bench, figures, arguments.inputs or INPUTS)
    return [(case.kind, case.title, figures_of(case, *counts_of(figures, case, options))) for case in inputs]


def ratio_to(start, found):
    """How much worse one input's figures are than at the start: 1 is equal."""
    cells = SEARCH_WEIGHT * (found["search"] / start["search"] - 1)
    if "filled" in start:
        return (found["wrong_of_all"] + 1) / (start["wrong_of_all"] + 1) / 2 + start["filled"] / max(found["filled"], 1) / 2 + cells
    weights = {name: weight for name, weight in WEIGHTS.items() if start.get(name)}
    return sum(weight * found[name] / start[name] for name, weight in weights.items()) / sum(weights.values()) + cells


def score_of(ratios):
    """The mean over kinds of the means over their inputs. `ratios`: (kind, ratio) of every input."""
    by_kind = {}
    for kind, ratio in ratios:
        by_kind.setdefault(kind, []).append(ratio)
    return sum(sum(values) / len(values) for values in by_kind.values()) / len(by_kind)


def is_better(found, best):
    """Whether a trial wins by LEAST_GAIN, and wins whichever input is left out. Both: (kind, ratio) of every input."""
    if score_of(found) > score_of(best) - LEAST_GAIN:
        return False
    return len(found) < 3 or all(score_of(found[:i] + found[i + 1:]) < score_of(best[:i] + best[i + 1:]) for i in range(len(found)))


class Search:
    def __init__(self, bench, arguments):
        self.bench, self.arguments, self.variant = bench, arguments, Variant(bench)
        self.start = None
        device = bench.video_figures().egosgm.devices()[0]
        bench.device = {"name": device.name, "driver": device.driver}

    def ratios(self, constants):
        macros = {name: value for name, value in constants.items() if name.startswith("EGOSGM_")}
        options = {f"constants.{name}": value for name, value in constants.items() if name not in macros}
        program = self.variant.program(macros)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found = pool.apply(evaluate, (self.arguments, program, options))
        self.start = self.start or found
        return [(kind, ratio_to(before, figures)) for (kind, _, figures), (_, _, before) in zip(found, self.start)], found

    def run(self, seconds, pattern):
        end, defaults = time.monotonic() + seconds, default_constants()
        best, chosen = self.ratios({})[0], {}
        print_inputs(self.start)
        names = [name for name in defaults if re.search(pattern, name)]
        random.Random(self.arguments.seed).shuffle(names)
        for name in names:
            for value in steps_from(defaults[name]):
                while time.monotonic() < end:
                    trial = chosen | {name: value}
                    try:
                        ratios, found = self.ratios(trial)
                    except Exception as reason:
                        print(f"       {name}={value}: {reason}", flush=True)
                        break
                    better = is_better(ratios, best)
                    kinds = {kind: score_of([r for r in ratios if r[0] == kind]) for kind, _ in ratios}
                    print(f"{'TAKEN ' if better else '      '} {name}={value} {score_of(ratios):.4f} " + " ".join(f"{k} {v:.3f}" for k, v in kinds.items()), flush=True)
                    if not better:
                        break
                    best, chosen, last = ratios, trial, found
                    further = steps_from(value)
                    if not further:
                        break
                    value = further[0] if value > defaults[name] else further[-1]
        if chosen:
            print_inputs(last)
        return [{"name": name, "default": defaults[name], "found": value} for name, value in chosen.items()]


def print_inputs(found):
    for _, title, figures in found:
        print(f"{title:<20} " + "  ".join(f"{name} {value:.3g}" for name, value in figures.items()), flush=True)
