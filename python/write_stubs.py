# SPDX-License-Identifier: Apache-2.0
"""write_stubs.py STUB FOLDER: writes the stub, and _options.pyi, beside the module that lies in FOLDER. Needs no NumPy."""
import importlib.util
import pathlib
import re
import sys

stub, folder = map(pathlib.Path, sys.argv[1:])


def with_properties(text):
    """The attributes of classes as properties, which nobody can set."""
    return re.sub(r"^    (\w+): (?!ClassVar)(.+)$", r"    @property\n    def \1(self) -> \2: ...", text, flags=re.MULTILINE)


library = next(folder.glob("_egosgm*.so"))
spec = importlib.util.spec_from_file_location("_egosgm", library)
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)

lines = ["# Generated from the library's own lists of options and outputs. Do not edit.", "from typing import Optional, TypedDict", "", "import numpy as np",
         "from numpy.typing import NDArray", ""]
for name, options in (("PipelineOptions", module.pipeline_options()), ("StereoOdometryOptions", module.odometry_options()),
                      ("SyntheticOptions", module.synthetic_options())):
    lines.append(f"class {name}(TypedDict, total=False):")
    lines += [f"    {key}: {type(value).__name__}  # {value}" for key, value in options.items() if key != "preset"]  # an argument of its own
    lines.append("")
maps = "".join(f"    {name}: Optional[NDArray[np.{values}]]\n" for name, values, _ in module._OUTPUTS)
(folder / "_options.pyi").write_text("\n".join(lines) + "\nclass FrameMaps:\n" + with_properties(maps))
(folder / stub.name).write_text(with_properties(stub.read_text()))
