# SPDX-License-Identifier: Apache-2.0
"""Threads that begin at once, forked processes, the interpreter's end, and peaks of memory: each in a process of its own."""
import re
import struct
import subprocess
import sys
import zlib

import pytest

BEGIN = """
import atexit, multiprocessing, os, sys, threading, time
at_end = []
atexit.register(lambda: [act() for act in at_end])  # after the library, which registers later
import numpy
import numpy.core.multiarray

class LetsOthersRun:  # where pybind11 asks for NumPy's functions, which Python may do at any time
    def __getattr__(self, name, of=numpy.core.multiarray):
        time.sleep(0.05)
        return getattr(of, name)

sys.modules["numpy.core.multiarray"] = LetsOthersRun()
import egosgm
SIZE = 64, 48
CALIBRATION = egosgm.Calibration(100, 100, 32, 24, 0.5)
IMAGE = numpy.random.default_rng(1).integers(0, 256, SIZE[::-1], dtype=numpy.uint8)

def pipeline():
    return egosgm.Pipeline(CALIBRATION, *SIZE, disparities=16, temporal=False)

def in_threads(work, count=3, daemon=False):
    threads = [threading.Thread(target=work, daemon=daemon) for _ in range(count)]
    for thread in threads:
        thread.start()
    return threads
"""


def run(code, times=1):
    """In new processes; what the last one printed."""
    for _ in range(times):
        done = subprocess.run([sys.executable, "-c", BEGIN + code], capture_output=True, text=True, timeout=900)
        assert done.returncode == 0 and not done.stderr, (done.returncode, done.stderr)
    return done.stdout


def test_threads_may_hand_over_their_first_arrays_at_once():
    run("""
def work():
    egosgm.StereoOdometry(CALIBRATION).process(IMAGE, IMAGE)
for thread in in_threads(work):
    thread.join()
""")


def test_threads_may_make_their_first_pipelines_at_once():
    printed = run("""
barrier = threading.Barrier(3)
def work():
    barrier.wait()
    print(int(pipeline().process(IMAGE, IMAGE).disparity.shape == IMAGE.shape), end="", flush=True)
for thread in in_threads(work):
    thread.join()
""", times=5)
    assert printed == "111"


@pytest.mark.parametrize("call", ["pipeline()", "egosgm.devices()", "parents.process(IMAGE, IMAGE)", "parents.submit(IMAGE, IMAGE)", "parents.collect()"])
def test_a_forked_child_is_told_to_spawn(call):
    printed = run(f"""
parents = pipeline()
parents.process(IMAGE, IMAGE)
def work():
    while not is_over:
        parents.process(IMAGE, IMAGE)  # has its turn when the child is made
is_over = False
thread, = in_threads(work, 1)
child = os.fork()
if child == 0:
    try:
        {call}
    except egosgm.DeviceError as error:
        print(error, flush=True)
    sys.exit(0)
is_over = True
assert os.waitpid(child, 0)[1] == 0
thread.join()
""")
    assert 'forked' in printed and '"spawn"' in printed


def test_a_pool_of_forked_processes_gets_the_error():
    printed = run("""
parents = pipeline()
def work(number):
    return pipeline().options["disparities"]
with multiprocessing.get_context("fork").Pool(2) as pool:
    try:
        pool.map(work, range(2))
    except egosgm.DeviceError as error:
        print(error)
""")
    assert '"spawn"' in printed


def test_a_forked_child_may_find_motions_and_begin_with_opencl_itself():
    run("""
odometry = egosgm.StereoOdometry(CALIBRATION)
odometry.process(IMAGE, IMAGE)
child = os.fork()
if child == 0:
    odometry.process(IMAGE, IMAGE)
    pipeline().process(IMAGE, IMAGE)  # the parent has not used it
    sys.exit(0)
assert os.waitpid(child, 0)[1] == 0
""")


@pytest.mark.parametrize("call", ["large.process(image, image)", "egosgm.compare_disparity(maps, maps)", "street.render(0)"])
def test_daemon_threads_end_with_the_interpreter(call):
    run(f"""
large = egosgm.Pipeline(CALIBRATION, 640, 480, disparities=16, temporal=False)
street = egosgm.SyntheticSequence(width=640, height=480, frames=2)
image, maps = numpy.tile(IMAGE, (10, 10)), numpy.ones((240, 320), numpy.float32)
class Late:
    def __del__(self, sleep=time.sleep):
        sleep(0.3)  # while the interpreter ends
late = Late()
begun = threading.Barrier(3)
def work():
    begun.wait()
    while True:
        {call}
in_threads(work, 2, daemon=True)
begun.wait()
time.sleep(0.1)
""", times=2)


@pytest.mark.parametrize("call", ["large.process(Slow(), IMAGE)", "egosgm.read_grey(Slow())", "frame.left"])
def test_the_interpreter_ends_after_calls_in_which_python_runs(call, tmp_path):
    """The interpreter would take the lock from their thread there, and end it in the middle of C++."""
    run(f"""
import pathlib
for side in "lr":
    egosgm.write_disparity(f"{tmp_path}/{{side}}.png", IMAGE.astype(numpy.float32))
frame, = egosgm.open_patterns("{tmp_path}/l.png", "{tmp_path}/r.png").frames
large = pipeline()
begun, ended = threading.Event(), []
def slow(result, sleep=time.sleep):
    begun.set()
    sleep(0.3)
    ended.append(result)
    return result
class Slow:
    def __array__(self, *_, **__):
        return slow(IMAGE)
    def __fspath__(self):
        return slow("nowhere.png")
pathlib.Path = slow  # which the library makes of a name
def work():
    try:
        {call}
    except egosgm.InvalidArgument:
        pass
in_threads(work, 1, daemon=True)
begun.wait()
at_end.append(lambda: ended or os.write(2, b"ended in the middle of a call"))
""")


def png(width, height, bits, colour, **chunks):
    chunks = dict(IHDR=struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0), **chunks, IEND=b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(data)) + name.encode() + data + struct.pack(">I", zlib.crc32(name.encode() + data))
                                           for name, data in chunks.items())


# SECURITY.md: a refused file below 64 KiB takes less than 256 MiB. What the node and bags decode goes through grey_of.
@pytest.mark.parametrize("read", ["egosgm.read_grey(file)", "egosgm.read_color(file)", "egosgm.read_disparity(file)", "egosgm.open_folder(folder).size",
                                  "list(egosgm.run(folder, progress=False))",
                                  'egosgm.bag.ros_images.grey_of(types.SimpleNamespace(format="png", data=open(file, "rb").read()))'])
@pytest.mark.parametrize("bomb", [png(8192, 4096, 8, 0, IDAT=zlib.compress(b"")), png(16384, 16384, 1, 3, PLTE=bytes(6), IDAT=zlib.compress(bytes(16384 * 2049), 9))],
                         ids=["header alone", "palette of one bit"])
def test_a_small_file_that_says_a_huge_size_takes_little_memory(tmp_path, bomb, read):
    assert len(bomb) < 65536
    for side in (0, 1):
        (tmp_path / f"image_{side}").mkdir()
        (tmp_path / f"image_{side}/000000.png").write_bytes(bomb)
    (tmp_path / "calib.txt").write_text("P0: 100 0 50 0 0 100 50 0 0 0 1 0\nP1: 100 0 50 -50 0 100 50 0 0 0 1 0\n")
    said = run(f"""
import types
import egosgm.bag.ros_images
folder, file = {str(tmp_path)!r}, {str(tmp_path / "image_0/000000.png")!r}
try:
    {read}
except egosgm.InvalidArgument as error:
    print(error)
print(open("/proc/self/status").read())  # the peak of this program alone; ru_maxrss is no less than what its parent had
""")
    assert "too short" in said
    assert int(re.search(r"VmHWM:\s+(\d+) kB", said)[1]) / 1024 < 256
