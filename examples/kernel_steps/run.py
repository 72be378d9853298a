#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Five forms of one kernel, from a plain loop to that of the library: the same bits, and the least time of nineteen. Needs pyopencl.

  python3 run.py [DEVICE NUMBER]    docs/develop/a-kernel.md tells what each step is for
"""
import pathlib
import sys

import numpy
import pyopencl as cl

WIDTH, HEIGHT, TURNS = 1242, 375, 19
MOST, LEAST, SLOPE = 170, 40, 3


def main(device=None):
    context = cl.Context([cl.get_platforms()[0].get_devices()[int(device or 0)]])
    queue = cl.CommandQueue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
    images = numpy.random.default_rng(1).integers(0, 256, (2, HEIGHT, WIDTH), numpy.uint8)
    source = cl.Buffer(context, cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, hostbuf=images)
    expected, first_ms, status = None, None, 0
    for file in sorted(pathlib.Path(__file__).resolve().parent.glob("*.cl")):
        kernel = cl.Kernel(cl.Program(context, file.read_text()).build(), "penalties")
        steps, times = numpy.empty((2, HEIGHT, WIDTH, 4), numpy.uint8), []
        target = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, steps.nbytes)
        items = (WIDTH if file.name.startswith("1") else 1, HEIGHT, 2)
        for _ in range(TURNS):
            done = kernel(queue, items, None if items[0] > 1 else (1, 1, 1), *map(numpy.int32, (WIDTH, HEIGHT, MOST, LEAST, SLOPE)), source, target)
            done.wait()
            times.append(1e-6 * (done.profile.end - done.profile.start))
        cl.enqueue_copy(queue, steps, target)
        expected = steps if expected is None else expected
        first_ms = first_ms or min(times)
        same = numpy.array_equal(steps, expected)
        status |= not same
        print(f"{file.stem:12} {min(times):8.3f} ms  {first_ms / min(times):6.1f} times as fast  {'the same bits' if same else 'DIFFERS'}")
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
