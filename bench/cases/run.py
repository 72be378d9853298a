#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs kernels that stand alone: each folder beside this file holds one (case.json, kernel.cl, its buffers). Needs pyopencl.

  python3 run.py [CASE]...    builds each, launches it, holds what it writes against the checksums, and prints its least time of nine
Exit code 1 where a buffer differs. PYOPENCL_CTX chooses the device.
"""
import hashlib
import json
import pathlib
import sys

import numpy
import pyopencl as cl

HERE = pathlib.Path(__file__).resolve().parent


class Case:
    """A launch: its text, its arguments as NumPy has them, and what is to come out."""

    def __init__(self, folder):
        self.told = json.loads((folder / "case.json").read_text())
        self.source = (folder / self.told["source"]).read_text()
        self.buffers = {name: numpy.fromfile(folder / of["file"], numpy.uint8) for name, of in self.told["buffers"].items()}
        self.sha256 = {name: of["sha256"] for name, of in self.told["buffers"].items() if of["is_result"]}

    def arguments(self, buffer_of):
        """In their order; `buffer_of` makes a buffer's argument of its name."""
        for told in self.told["arguments"]:
            if "buffer" in told:
                yield buffer_of(told["buffer"])
            elif "local_bytes" in told:
                yield cl.LocalMemory(told["local_bytes"])
            else:
                yield numpy.void(bytes.fromhex(told["value"]))

    def run(self, context):
        """The names of buffers that differ, and the least time [ms]."""
        queue = cl.CommandQueue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
        kernel = cl.Kernel(cl.Program(context, self.source).build(self.told["options"]), self.told["kernel"])
        times, wrong = [], []
        for turn in range(9):
            memory = {name: cl.Buffer(context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=values) for name, values in self.buffers.items()}
            done = kernel(queue, self.told["global"], self.told["local"], *self.arguments(memory.get))
            done.wait()
            times.append(1e-6 * (done.profile.end - done.profile.start))
        for name, expected in self.sha256.items():
            found = numpy.empty_like(self.buffers[name])
            cl.enqueue_copy(queue, found, memory[name])
            wrong += [name] if hashlib.sha256(found.tobytes()).hexdigest() != expected else []
        return wrong, min(times)


def main(names):
    context = cl.create_some_context(interactive=False)
    status = 0
    for folder in sorted(HERE / name for name in names) if names else sorted(file.parent for file in HERE.glob("*/case.json")):
        wrong, ms = Case(folder).run(context)
        print(f"{folder.name:32} {ms:9.3f} ms  {'differs: ' + ', '.join(wrong) if wrong else 'the same bits'}", flush=True)
        status |= bool(wrong)
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
