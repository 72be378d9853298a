#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Finds the group size of a kernel that stands alone by Kernel Tuner, which takes only sizes that give the same bits. Needs kernel-tuner and pyopencl.

  python3 tune.py CASE RESULTS.json    tries the divisors of its range up to 64, and writes what it found in the form T4
  python3 tune.py --best RESULTS.json  names the fastest of such a file, whoever wrote it
"""
import hashlib
import json
import pathlib
import sys

import kernel_tuner
import numpy
from kernel_tuner.file_utils import store_output_file
from run import HERE, Case

MOST = 64  # work-items along a side


def tune(name, results):
    case = Case(HERE / name)
    told, order = case.told, [argument.get("buffer") for argument in case.told["arguments"]]
    if any("local_bytes" in argument for argument in told["arguments"]) or len(set(filter(None, order))) < len(list(filter(None, order))):
        raise SystemExit(f"tune: {name} has local memory, or one buffer twice: Kernel Tuner cannot give it that")

    def same_bits(_, found, atol):
        return all(hashlib.sha256(values.tobytes()).hexdigest() == case.sha256[buffer] for buffer, values in zip(order, found) if buffer in case.sha256)

    sides = [*told["global"], 1, 1][:3]
    params = {f"block_size_{axis}": [n for n in range(1, MOST + 1) if side % n == 0] for axis, side in zip("xyz", sides)}
    found, _ = kernel_tuner.tune_kernel(
        told["kernel"], case.source, tuple(sides), list(case.arguments(lambda buffer: case.buffers[buffer].copy())), params, lang="OpenCL",
        compiler_options=told["options"].split(), verify=same_bits,
        answer=[case.buffers[buffer] if buffer in case.sha256 else None for buffer in order],
        restrictions=[f"block_size_x * block_size_y * block_size_z <= {MOST}"])
    store_output_file(results, found, params)


def best(results):
    """Of the results in form T4: those that are right, by their time."""
    rows = [row for row in json.loads(pathlib.Path(results).read_text())["results"] if row["invalidity"] == "correct"]
    times = [next(numpy.mean(m["value"]) for m in row["measurements"] if m["name"] == "time") for row in rows]
    row = rows[int(numpy.argmin(times))]
    print(f"{len(rows)} sizes give the same bits; fastest: {row['configuration']}, {min(times):.3f} ms")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    if sys.argv[1] == "--best":
        best(sys.argv[2])
    else:
        tune(*sys.argv[1:])
        best(sys.argv[2])
