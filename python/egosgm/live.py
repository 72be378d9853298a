# SPDX-License-Identifier: Apache-2.0
"""egosgm live: two cameras, or one that gives both views, matched and shown as they come. In Python: LivePairs."""
import atexit
import collections
import contextlib
import http.server
import os
import pathlib
import shlex
import sys
import threading
import time
import urllib.parse
import warnings
from typing import Any, Deque, Dict, Iterator, Optional, Sequence, Tuple, Union

from . import _egosgm
from .arguments import Parser, counted, on_interrupt, say, tell
from .calibration.raw_pairs import RawPair, is_camera, open_pairs
from .calibration.rectify import Rectifier, SequenceFolder, add_calibration, unit_m
from .drive import run
from .viewer import RerunOutput

import cv2
import numpy as np

_MOST_WAIT_S = 5.0
_HTML = b"""<!doctype html><title>egosgm</title><link rel=icon href=data:,><style>body{margin:0;background:#111;color:#eee;font:16px sans-serif}img{width:100%}</style>
<p id=state>waits for pictures</p><img id=picture><script>
(async () => {
  for (let number = 0;;) {
    const answer = await fetch('picture?' + number).catch(() => ({}));
    if (!answer.ok) break;
    number = answer.headers.get('number');
    URL.revokeObjectURL(picture.src);
    picture.src = URL.createObjectURL(await answer.blob());
    await picture.decode();
    state.textContent = answer.headers.get('state');
  }
  state.textContent = 'ended: ' + state.textContent;
})();
</script>"""


class LivePairs:
    """Rectified pairs (left, right) for run(), each the newest one: pairs that come while nobody asks are dropped. A video plays at its rate.

    left, right: cameras by their numbers or devices, or videos; or one source of both views. calib: as `egosgm rectify` takes it.
    """

    def __init__(self, left: Union[int, str, None] = None, right: Union[int, str, None] = None, *, side_by_side: Union[int, str, None] = None,
                 top_bottom: Union[int, str, None] = None, calib: Union[str, "os.PathLike[str]", Sequence[str]], unit_m: Optional[float] = None, fisheye: bool = False) -> None:
        sources = dict(left=left, right=right, side_by_side=side_by_side, top_bottom=top_bottom)
        for name, source in sources.items():
            if not isinstance(source, (int, str, os.PathLike, type(None))) or isinstance(source, int) and source < 0:
                what = source if isinstance(source, int) else f"a {type(source).__name__}"
                raise _egosgm.InvalidArgument(f"{name} is {what}: give a camera's number, from 0 on, a device or the name of a video")
        if not isinstance(calib, (str, os.PathLike, list, tuple)):
            raise _egosgm.InvalidArgument(f"calib is a {type(calib).__name__}: give the name of a calibration's file, or one for each camera")
        given = [None if source is None else str(source) for source in sources.values()]
        if [source is not None for source in given] not in ([True, True, False, False], [False, False, True, False], [False, False, False, True]):
            raise _egosgm.InvalidArgument("give one input: --left and --right, or --side-by-side, or --top-bottom; each is a camera, such as 0 or /dev/video0, or a video")
        self._source = open_pairs(*given, None, None, False)
        self._keeps_time = not any(source and is_camera(source) for source in given)
        self._stream = iter(self._source)
        first = next(self._stream, None)
        if first is None:
            raise _egosgm.InvalidArgument(f"the input has no pair{': ' * bool(self._source.note)}{self._source.note}")
        self.rectifier = Rectifier(list(calib) if isinstance(calib, (list, tuple)) else [os.fspath(calib)], first.left.shape[1::-1], unit_m, fisheye)
        self.rectifier(RawPair(first.left, first.right))  # a pair of its own: the first one is rectified when it is asked for
        self.calibration, self.dropped = self.rectifier.calibration, 0
        self._newest: Optional[RawPair] = first
        self.taken_s = self._newest_s = self._begin_s = time.monotonic()  # taken_s: when the pair came that was handed out last
        self._has_ended = False
        self._error: Optional[Exception] = None
        self._changed = threading.Condition()  # reentrant, so that a signal's handler may close
        self._reader = threading.Thread(target=self._read, daemon=True)
        atexit.register(self._end)
        self._reader.start()

    def _end(self) -> None:
        """Python's end would stop the reader within OpenCV, which aborts the process. A camera may hang for good, so the wait has an end."""
        self.close()
        self._reader.join(_MOST_WAIT_S)

    def _read(self) -> None:
        try:
            for pair in self._stream:
                with self._changed:
                    if self._keeps_time and pair.time_s is None:  # pictures without times: each one waits for its turn
                        self._changed.wait_for(lambda: self._newest is None or self._has_ended)
                    elif self._keeps_time:
                        due_s = self._begin_s + (pair.time_s or 0)
                        self._changed.wait_for(lambda: self._has_ended, max(0.0, due_s - time.monotonic()))
                    if self._has_ended:
                        return
                    self.dropped += self._newest is not None
                    self._newest, self._newest_s = pair, time.monotonic()
                    self._changed.notify_all()
        except Exception as error:  # told once the pairs before it are handed out
            self._error = error
        finally:
            self._stream.close()  # which releases the cameras
            self.close()
            atexit.unregister(self._end)

    def __iter__(self) -> Iterator[Tuple[Any, Any]]:
        if self._has_ended and self._newest is None and not self._error:
            raise _egosgm.InvalidArgument("the input has ended, and gives its pairs once: make LivePairs anew")
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest is not None or self._has_ended)
                pair, self._newest, self.taken_s = self._newest, None, self._newest_s
                self._changed.notify_all()
            if pair is None:
                break
            self.rectifier(pair)
            yield pair.left, pair.right
        if self._error:
            raise self._error

    @property
    def note(self) -> str:
        """What of the input could not be used."""
        return str(self._source.note)

    def __enter__(self) -> "LivePairs":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """No more pairs are read; the newest one is still handed out."""
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()


class _Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        page: Any = self.server.page  # type: ignore[attr-defined]
        path = urllib.parse.urlsplit(self.path)
        if path.path == "/picture" and path.query.isdecimal():
            page._answer(self, int(path.query))
        elif path.path == "/":
            page._send(self, 200, "text/html", _HTML)
        else:
            page._send(self, 404, "text/plain", b"")

    def log_message(self, *_: Any) -> None:
        pass


class Page:
    """A page that shows the newest picture to browsers of this machine."""

    def __init__(self, port: int = 0) -> None:
        self._changed, self._number, self._picture, self._state, self._has_ended = threading.Condition(), 0, b"", "", False
        try:
            self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), _Handler)
        except OSError as error:
            raise _egosgm.InvalidArgument(f"--port {port}: {error.strerror}: choose another one, or leave it out") from None
        self._server.daemon_threads = True
        self._server.page = self  # type: ignore[attr-defined]
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _answer(self, request: Any, after: int) -> None:
        """A picture that is newer than the one that the browser has; where the pictures end, 410."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > after or self._has_ended)
            number, picture, state = self._number, self._picture, self._state
        if number > after:
            self._send(request, 200, "image/jpeg", picture, {"number": str(number), "state": state})
        else:
            self._send(request, 410, "text/plain", b"")

    @staticmethod
    def _send(request: Any, code: int, kind: str, content: bytes, headers: Any = {}) -> None:
        try:
            request.send_response(code)
            for name, value in {"Content-Type": kind, "Content-Length": str(len(content)), "Cache-Control": "no-store", **headers}.items():
                request.send_header(name, value)
            request.end_headers()
            request.wfile.write(content)
        except ConnectionError:  # the browser has gone
            pass

    def show(self, picture: Any, state: str) -> None:
        """picture: RGB of 8 bits."""
        content = cv2.imencode(".jpg", picture[..., ::-1])[1].tobytes()
        with self._changed:
            self._number, self._picture, self._state = self._number + 1, content, state
            self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()


def picture_of(left: Any, disparity: Any, smallest: int, disparities: int) -> Any:
    """The left image above its disparities, near red and far blue, black where there is none. They are searched from `smallest` on."""
    left = left if left.dtype == np.uint8 else (left >> 8).astype(np.uint8)
    left = np.repeat(left[..., None], 3, 2) if left.ndim == 2 else left[..., :3]
    is_there = np.isfinite(disparity) & (disparity > _egosgm.INVALID_DISPARITY)
    steps = np.clip(np.where(is_there, disparity - smallest, 0) * (255 / disparities), 0, 255).astype(np.uint8)
    return np.vstack([left, cv2.applyColorMap(steps, cv2.COLORMAP_TURBO)[..., ::-1] * is_there[..., None].astype(np.uint8)])


class PageOutput:
    """The page of a run, `egosgm run --show`."""

    def __init__(self, options: Dict[str, Any]) -> None:
        self._range, self._page = (options["min_disparity"], options["disparities"]), Page()
        say(f"{self._page.address} shows the run")

    def add(self, frame: Any, maps: _egosgm.Frame, motion: Any, calibration: _egosgm.Calibration) -> None:
        self._page.show(picture_of(frame.left, maps.disparity, *self._range), f"frame {frame.name}, density {100 * maps.report.density:.1f} %")

    def finish(self) -> None:
        self._page.close()

    give_up = finish


def _parser() -> Parser:
    parser = Parser("live", description="Match what two cameras see as they see it, and show it on a page in the browser. Pairs are dropped rather than late.")
    add = parser.add_argument_group("input (one of); each is a camera, such as 0 or /dev/video0, or a video").add_argument
    add("cameras", metavar="CAMERA", nargs="*", help="the left and the right camera, as --left and --right take them")
    add("--left", metavar="CAMERA", help="the left camera")
    add("--right", metavar="CAMERA", help="the right camera")
    add("--side-by-side", metavar="CAMERA", help="a camera with the left view in the left half and the right one in the right half")
    add("--top-bottom", metavar="CAMERA", help="a camera with the left view in the upper half and the right one in the lower half")
    add_calibration(parser)
    add = parser.add_argument
    add("--record", metavar="DIR", help="new folder: the rectified pairs that were matched, as a sequence that `egosgm run` reads")
    add("--set", metavar="NAME=VALUE", action="append", default=[], help="an option, as `egosgm run` takes it, such as disparities=64")
    add("--device", default="", metavar="D", help="the device, as `egosgm run` takes it")
    add("--port", type=int, default=0, metavar="N", help="of the page; without: a free one")
    add("--rerun", action="store_true", help="show it in the viewer Rerun in place of the page")
    return parser


def _options(words: Sequence[str]) -> Any:
    options = {}
    for word in words:
        name, is_there, value = word.partition("=")
        if not (name and is_there and value):
            raise _egosgm.InvalidArgument(f"--set {word}: give NAME=VALUE")
        options[name] = value
    return options


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    if not 0 <= given.port < 65536:
        raise _egosgm.InvalidArgument(f"--port {given.port}: choose from 0 to 65535")
    options = _options(given.set)
    known = _egosgm.pipeline_options(**options)
    if len(given.cameras) == 1:
        raise _egosgm.InvalidArgument(f"{given.cameras[0]}: one camera: say how its views lie, by --side-by-side or --top-bottom, or give a right one too")
    if given.cameras:
        if len(given.cameras) > 2 or given.left or given.right:
            raise _egosgm.InvalidArgument(f"{' '.join(given.cameras)}: too many cameras: give a left and a right one")
        given.left, given.right = given.cameras
    if given.record:
        _egosgm._expect_new_folder("--record", pathlib.Path(given.record))
    pairs = LivePairs(given.left, given.right, side_by_side=given.side_by_side, top_bottom=given.top_bottom, calib=given.calib, unit_m=unit_m(given.unit),
                      fisheye=given.fisheye)
    video = run(pairs, pairs.calibration, lag=0, progress=False, device=given.device, **options)
    on_interrupt(pairs.close)
    record = SequenceFolder(pathlib.Path(given.record)) if given.record else None
    begin_s, shown = pairs.taken_s, 0
    shown_s: Deque[float] = collections.deque(maxlen=30)  # the rate is that of the last ones
    with contextlib.ExitStack() as at_end:  # each is called, whatever another one throws
        viewer, page = (RerunOutput(), None) if given.rerun else (None, Page(given.port))
        at_end.callback(viewer.finish if viewer else page.close)
        at_end.callback(lambda: record.finish(pairs.rectifier) if record and record.frames else None)
        at_end.callback(pairs.close)
        at_end.enter_context(warnings.catch_warnings())
        warnings.showwarning = lambda message, *_, **__: say(str(message))
        is_terminal = sys.stdout is not None and sys.stdout.isatty()
        at_end.callback(lambda: tell("") if is_terminal and shown else None)
        for frame in video:
            shown += 1
            shown_s.append(time.monotonic())
            rate = (len(shown_s) - 1) / max(shown_s[-1] - shown_s[0], 1e-9)
            state = f"{rate:.1f} pairs/s, {1000 * (shown_s[-1] - pairs.taken_s):.0f} ms old, {pairs.dropped} dropped"
            if page:
                page.show(picture_of(frame.left, frame.disparity, known["min_disparity"], known["disparities"]), state)
            if viewer:
                viewer.add(frame, frame.maps, frame.motion, frame.calibration)
            if record:
                record.add(RawPair(frame.left, frame.right, pairs.taken_s - begin_s))
            if page and shown == 1:  # not before: the first frame tells whether there is a device, and room for the record
                tell(f"{page.address} shows it; Ctrl-C ends it")
            tell(f"\r\x1b[K{state}" if is_terminal else state, end="" if is_terminal else "\n")
    if pairs.note:
        say(pairs.note)
    tell(f"{counted(shown, 'pair')} matched, {pairs.dropped} dropped" + (f"; egosgm run {shlex.quote(given.record)} --out OUT" if record and record.frames else ""))
    return 0
