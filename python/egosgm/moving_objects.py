# SPDX-License-Identifier: Apache-2.0
"""Pictures of the objects that a run found: `egosgm run --write objects`."""
import colorsys
import csv
import pathlib
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import PIL.Image
import PIL.ImageDraw

from . import _egosgm
from .viewer import ARROW_FRAMES

_NEAREST_M = 0.1


def _color_of(number: int) -> Tuple[int, int, int]:
    red, green, blue = colorsys.hsv_to_rgb(0.618034 * number % 1, 0.9, 1)
    return round(255 * red), round(255 * green), round(255 * blue)


class ObjectPictures:
    """The left images of a run with what moves by itself: coloured, boxed, with an arrow along the velocity and the speed per frame."""

    def __init__(self, folder: pathlib.Path, calibration: Dict[str, Any]) -> None:
        self._folder, self._calibration = folder, calibration
        self._rows: Dict[str, List[Dict[str, float]]] = {}
        file = folder / "objects.csv"
        if not file.exists():
            return
        try:
            with open(file, newline="", encoding="utf-8") as table:
                for row in csv.DictReader(table):
                    self._rows.setdefault(row.pop("frame"), []).append({name: float(value) for name, value in row.items()})
        except (KeyError, TypeError, ValueError) as error:
            raise _egosgm.InvalidArgument(f"{file}: is damaged ({error}): run it again into a new folder") from None

    def picture(self, name: str, left: str) -> Optional[np.ndarray]:
        """Of a frame, from its left image; None where the run wrote no objects of it, or the image is no longer there."""
        file = self._folder / "objects" / f"{name}.png"
        if not left or not file.exists():
            return None
        labels, grey = _egosgm.read_grey(file), _egosgm.read_grey(left)
        if labels.shape != grey.shape:
            raise _egosgm.InvalidArgument(f"{file}: is {labels.shape[1]}x{labels.shape[0]}, while the left image is {grey.shape[1]}x{grey.shape[0]}")
        grey = (grey / (256 if grey.dtype == np.uint16 else 1)).astype(np.uint8)
        picture = np.repeat(grey[..., None], 3, axis=2)
        for number in np.unique(labels[labels > 0]):
            marked = labels == number
            picture[marked] = picture[marked] // 2 + np.array(_color_of(int(number)), np.uint8) // 2
        image = PIL.Image.fromarray(picture)
        draw = PIL.ImageDraw.Draw(image)
        for row in self._rows.get(name, []):
            self._add(draw, row)
        return np.asarray(image)

    def _place(self, point: np.ndarray) -> Tuple[float, float]:
        c, depth = self._calibration, max(float(point[2]), _NEAREST_M)
        return c["fx"] * point[0] / depth + c["cx"], c["fy"] * point[1] / depth + c["cy"]

    def _add(self, draw: Any, row: Dict[str, float]) -> None:
        color = _color_of(int(row["id"]))
        centre, velocity = np.array([row["x_m"], row["y_m"], row["z_m"]]), np.array([row["vx_m"], row["vy_m"], row["vz_m"]])
        draw.rectangle([row["left"], row["top"], row["right"], row["bottom"]], outline=color)
        start, end = self._place(centre), self._place(centre + ARROW_FRAMES * velocity)
        draw.line([start, end], fill=color, width=2)
        draw.ellipse([end[0] - 3, end[1] - 3, end[0] + 3, end[1] + 3], fill=color)
        draw.text((row["left"], max(0, row["top"] - 12)), f"{int(row['id'])}: {np.linalg.norm(velocity):.2f} m", fill=color)
