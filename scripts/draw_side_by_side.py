#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Moving pictures of two runs. The left image and both runs' colours, beside each other, or above where they are wide."""
import pathlib
import sys

from usage import Parser

parser = Parser(__doc__)
for name in ("SEQUENCE", "LEFT_RUN", "RIGHT_RUN", "OUT.webp"):
    parser.add_argument(name, type=pathlib.Path)
chosen = parser.parse_args()
try:
    from PIL import Image, ImageDraw, ImageFont
except ImportError:
    sys.exit("no moving pictures without Pillow: apt install python3-pil")

FRAME_MS = 200
MOST_WIDTH, MOST_HEIGHT = 1280, 720  # of a moving picture [px]


def labelled(picture, text, size):
    try:
        font = ImageFont.truetype("DejaVuSans.ttf", size)
    except OSError:
        font = ImageFont.load_default()
    draw = ImageDraw.Draw(picture)
    draw.rectangle(draw.textbbox((6, 4), text, font=font), fill="black", outline="black", width=3)
    draw.text((6, 4), text, font=font, fill="white")
    return picture


def main(sequence, left, right, out):
    frames = []
    for file in sorted((left / "color").glob("*.png")):
        shown = (sequence / "image_0", sequence / "image_2", sequence / "left", right / "left")
        image = next((folder / file.name for folder in shown if (folder / file.name).exists()), None)
        if not image:
            sys.exit(f"{sequence}: no left image {file.name}: make RIGHT_RUN with --write color,left")
        pictures = [Image.open(path).convert("RGB") for path in (image, *(run / "color" / file.name for run in (left, right)))]
        width, height = pictures[0].size
        columns, rows = (1, 3) if width >= 2 * height else (3, 1)
        scale = min(1, MOST_WIDTH / (columns * width), MOST_HEIGHT / (rows * height))
        width, height = int(scale * width), int(scale * height)
        sheet = Image.new("RGB", (columns * width, rows * height))
        for i, (picture, name) in enumerate(zip(pictures, ("left image", left.name, right.name))):
            picture = labelled(picture.resize((width, height), Image.LANCZOS), name.replace("_", " "), max(12, height // 16))
            sheet.paste(picture, (i % columns * width, i // columns * height))
        frames.append(sheet)
    if not frames:
        sys.exit(f"{left / 'color'}: no pictures: run with --write color")
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=50, method=6)
    print(f"Moving pictures: {out}")


if __name__ == "__main__":
    main(*vars(chosen).values())
