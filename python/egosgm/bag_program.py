# SPDX-License-Identifier: Apache-2.0
"""egosgm run --bag: a drive that ROS recorded."""
import argparse
import contextlib
import pathlib
import signal
import sys
import threading
from typing import Any, Dict, List, NoReturn, Optional, Sequence

from . import _egosgm
from .bag import Bag, run
from .bag_outputs import FolderOutput, McapOutput
from .viewer import RerunOutput


def _value(text: str) -> Any:
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return {"true": True, "false": False}.get(text, text)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _egosgm.InvalidArgument(f"{message}: see `egosgm run --bag --help`")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="egosgm run --bag", description=__doc__, allow_abbrev=False)
    add = parser.add_argument
    add("--bag", required=True, metavar="FILE.mcap|FILE.bag|FOLDER", help="ROS 2 (MCAP, SQLite) or ROS 1")
    add("--left-topic", default="", metavar="TOPIC", help="raw or compressed images [where names tell, and there is one choice, that one]")
    add("--right-topic", default="", metavar="TOPIC")
    add("--info-topics", nargs=2, default=(), metavar=("LEFT", "RIGHT"), help="camera infos [camera_info beside the images]")
    add("--calib", default="", metavar="FILE|FOLDER", help="in place of camera infos: whatever egosgm.read_calibration reads, of raw images (OpenCV, ROS, "
        "Kalibr, EuRoC) or of rectified ones")
    add("--pose-topic", default="", metavar="TOPIC", help="motion from there (Odometry, PoseStamped) in place of stereo odometry")
    add("--pose-axes", default="body", metavar="body|optical", help="of the poses: x forward, z up, or z forward, y down [body]")
    add("--max-skew-ms", type=float, default=0.0, metavar="MS", help="how far the stamps of a pair may differ [0]")
    add("--rectify", default="auto", choices=("auto", "on", "off"), help="images by their infos [auto: where the infos have a distortion and "
        "the topic is not named rect]")
    add("--out", metavar="FILE.mcap|FILE.rrd|FOLDER", help="depth, disparity, variance, reasons, odometry and camera infos; the same for Rerun; "
        "or disparity maps as PNG")
    add("--rerun", action="store_true", help="starts the viewer Rerun, and shows each frame there")
    add("--device", default="", metavar="DEVICE")
    add("--preset", default="default", metavar="PRESET")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="an option, as egosgm run has it")
    add("--quiet", action="store_true", help="no progress")
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """What the program prints and returns."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # as an interrupt: nothing unfinished is left
    try:
        return _main(_parser().parse_args(arguments))
    except (_egosgm.InvalidArgument, _egosgm.IoError, _egosgm.DeviceError, OSError) as error:
        text = "".join(c if c.isprintable() else " " for c in str(error))  # names may hold anything
        print(f"egosgm: error: {text}", file=sys.stderr)
        return 2 if isinstance(error, _egosgm.InvalidArgument) else 1
    except KeyboardInterrupt:
        print("egosgm: interrupted", file=sys.stderr)
        return 130


def _output_of(out: pathlib.Path, bag: Bag, options: Dict[str, Any], preset: str) -> Any:
    if bag.path.is_dir() and bag.path.resolve() in (out.resolve(), *out.resolve().parents):
        raise _egosgm.InvalidArgument(f"--out {out}: lies in the bag {bag.path}, which is read: give another name")
    if out.suffix == ".rrd":
        return RerunOutput(out)
    known = {**_egosgm.pipeline_options(preset), **options}
    for name in ("disparities", "min_disparity"):
        if not isinstance(known[name], int):
            raise _egosgm.InvalidArgument(f"--set {name}={known[name]}: give a whole number")
    return McapOutput(out, known) if out.suffix == ".mcap" else FolderOutput(out, known)


def _main(given: argparse.Namespace) -> int:
    options = {}
    for text in given.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise _egosgm.InvalidArgument(f"--set {text}: give NAME=VALUE")
        if name in ("device", "preset"):
            raise _egosgm.InvalidArgument(f"--set {text}: give --{name} {value}")
        if name in ("bag", "outputs", "progress", "on_frame", "calibration", "width", "height"):  # what Python's run and Pipeline call theirs
            raise _egosgm.InvalidArgument(f"--set {text}: no option is named {name}")
        options[name.replace(".", "__")] = _value(value)
    if given.out == "":
        raise _egosgm.InvalidArgument("--out \"\": give a name, or leave it out")
    bag = Bag(given.bag, given.left_topic, given.right_topic, given.info_topics, given.pose_topic, given.max_skew_ms,
              {"auto": None, "on": True, "off": False}[given.rectify], given.pose_axes, given.calib)
    outputs: List[Any] = []
    try:
        if given.out:
            outputs.append(_output_of(pathlib.Path(given.out), bag, options, given.preset))
        if given.rerun:
            outputs.append(RerunOutput())
        told = run(bag, outputs, progress=False if given.quiet else None, device=given.device, preset=given.preset, **options)
        for output in outputs:
            output.finish()
    except BaseException:
        for output in outputs:
            output.give_up()
        raise
    print(f"{bag.path.name}: {told['frames']} frames, {bag.cameras.size[0]}x{bag.cameras.size[1]}{', rectified here' if told['rectified'] else ''}, "
          f"on {told['device']}; {told['motions']} motions; density {told['density']:.1%} in the mean" + (f": {given.out}" if given.out else ""))
    if told["gaps"].text():
        print(told["gaps"].text())
    for text in (*([told["doubt"]] if told["doubt"] else []), *told["problems"]):
        print(f"doubt: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
