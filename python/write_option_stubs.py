# SPDX-License-Identifier: Apache-2.0
"""write_option_stubs.py FOLDER: writes _options.pyi beside the module that lies there. Needs no NumPy."""
import importlib.util
import pathlib
import sys

folder = pathlib.Path(sys.argv[1])
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
lines.append("class FrameMaps:")
for name, values, _ in module._OUTPUTS:
    lines += ["    @property", f"    def {name}(self) -> Optional[NDArray[np.{values}]]: ..."]
lines.append("")
(folder / "_options.pyi").write_text("\n".join(lines))
