# SPDX-License-Identifier: Apache-2.0
"""Moving pictures of two runs. The left image above, both runs' colours below."""
import pathlib
import sys

from usage import Parser

parser = Parser(__doc__)
for name in ("SEQUENCE", "LEFT_RUN", "RIGHT_RUN", "OUT.webp"):
    parser.add_argument(name, type=pathlib.Path)
chosen = parser.parse_args()
try:
    from PIL import Image, ImageDraw, ImageOps
except ImportError:
    sys.exit("no moving pictures without Pillow: apt install python3-pil")

FRAME_MS = 200
LABEL_PART = 8  # of a picture's height


def label(text, height):
    """White on black, of that height whatever font there is."""
    drawn = Image.new("L", (8 * len(text) + 8, 14))
    ImageDraw.Draw(drawn).text((4, 1), text, fill=255)
    drawn = ImageOps.expand(drawn.crop(drawn.getbbox()), 3)
    return drawn.resize((drawn.width * height // drawn.height, height), Image.LANCZOS)


def main(sequence, left, right, out):
    frames = []
    for file in sorted((left / "color").glob("*.png")):
        pictures = [Image.open(run / "color" / file.name).convert("RGB") for run in (left, right)]
        width, height = pictures[0].size
        shown = Image.new("RGB", (2 * width, 2 * height))
        shown.paste(Image.open(next((sequence / folder / file.name for folder in ("image_0", "image_2", "left") if (sequence / folder / file.name).exists()))).convert("RGB"),
                    (width // 2, 0))
        for i, (run, picture) in enumerate(zip((left, right), pictures)):
            shown.paste(picture, (i * width, height))
            shown.paste(label(run.name.replace("_", " "), height // LABEL_PART), (i * width, height))
        frames.append(shown.resize((shown.width // 2, shown.height // 2)) if shown.width > 1280 else shown)
    if not frames:
        sys.exit(f"{left / 'color'}: no pictures: run with --write color")
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=80)
    print(f"Moving pictures: {out}")


if __name__ == "__main__":
    main(*vars(chosen).values())
