# SPDX-License-Identifier: Apache-2.0
"""Moving pictures of two runs: draw_side_by_side.py SEQUENCE LEFT_RUN RIGHT_RUN OUT.webp. The left image above, both runs' colours below."""
import pathlib
import sys

try:
    from PIL import Image, ImageDraw
except ImportError:
    sys.exit("no moving pictures without Pillow: apt install python3-pil")

FRAME_MS = 200


def main(sequence, left, right, out):
    frames = []
    for file in sorted((left / "color").glob("*.png")):
        pictures = [Image.open(run / "color" / file.name).convert("RGB") for run in (left, right)]
        width, height = pictures[0].size
        shown = Image.new("RGB", (2 * width, 2 * height))
        shown.paste(Image.open(next((sequence / folder / file.name for folder in ("image_0", "image_2", "left") if (sequence / folder / file.name).exists()))).convert("RGB"),
                    (width // 2, 0))
        draw = ImageDraw.Draw(shown)
        for i, (run, picture) in enumerate(zip((left, right), pictures)):
            shown.paste(picture, (i * width, height))
            draw.text((i * width + 8, height + 6), run.name.replace("_", " "), fill="white", stroke_width=2, stroke_fill="black")
        frames.append(shown.resize((shown.width // 2, shown.height // 2)) if shown.width > 1280 else shown)
    if not frames:
        sys.exit(f"{left / 'color'}: no pictures: run with --write color")
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=80)
    print(f"Moving pictures: {out}")


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*map(pathlib.Path, sys.argv[1:]))
