#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""show_disparity.py [SEQUENCE] [--out PICTURE.png]: disparity, its variance and what was searched, for the last frame of a sequence.

Without SEQUENCE (a folder in a layout of KITTI's or Middlebury's) a synthetic street is rendered. The cells between `# %%` run one by one
in Jupyter, VS Code or Spyder. Needs egosgm and matplotlib.
"""
# %% Which sequence
import argparse

import numpy as np

import egosgm

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("sequence", nargs="?", help="folder; default: a synthetic street")
parser.add_argument("--out", help="write a picture instead of opening a window")
arguments, _ = parser.parse_known_args()


def frames_of(folder):
    """Yields (left, right) one frame after the other, after calibration and size."""
    if folder:
        sequence = egosgm.open_folder(folder)
        yield sequence.calibration, sequence.size
        for frame in sequence.frames:
            yield frame.read()
    else:
        street = egosgm.SyntheticSequence(frames=4, width=640, height=240)
        yield street.calibration, (street.options["width"], street.options["height"])
        for i in range(len(street)):
            frame = street.render(i)
            yield frame.left, frame.right


# %% Match the sequence frame by frame
frames = frames_of(arguments.sequence)
calibration, (width, height) = next(frames)
pipeline = egosgm.Pipeline(calibration, width, height, disparities=128)
odometry = egosgm.StereoOdometry(calibration)
for left, right in frames:
    result = pipeline.process(left, right, odometry.process(left, right).motion, outputs=("disparity", "variance", "search_width"))
    print(f"searched {100 * min(1, result.report.search_fraction):.1f} %, density {100 * result.report.density:.1f} %")

# %% NumPy from here on: depth, and how sure it is
valid = result.disparity != egosgm.INVALID_DISPARITY
depth_m = egosgm.depth_from_disparity(result.disparity, calibration)
sigma_m = egosgm.depth_sigma_from_disparity(result.disparity, result.variance, calibration)
print(f"median depth {np.nanmedian(depth_m):.1f} m, median standard deviation {np.nanmedian(sigma_m):.2f} m")

# %% Look at it
try:
    import matplotlib
except ModuleNotFoundError:
    raise SystemExit("no pictures without matplotlib: pip install matplotlib")
if arguments.out:
    matplotlib.use("Agg")
import matplotlib.pyplot as plt

figure, axes = plt.subplots(2, 2, figsize=(13, 6), layout="constrained")
panels = [(left, "left image", "gray", {}), (np.where(valid, result.disparity, np.nan), "disparity [px]", "turbo", {}),
          (np.where(valid, np.sqrt(result.variance), np.nan), "standard deviation [px]", "turbo", {"vmax": 1.5}),
          (result.search_width, "disparities searched", "turbo", {"vmin": 0})]
for axis, (image, title, colors, limits) in zip(axes.flat, panels):
    shown = axis.imshow(image, cmap=colors, interpolation="nearest", **limits)
    axis.set_title(title)
    axis.set_facecolor("black")
    axis.set_axis_off()
    if colors == "turbo":
        figure.colorbar(shown, ax=axis, shrink=0.8)
if arguments.out:
    figure.savefig(arguments.out, dpi=110)
else:
    plt.show()
