# SPDX-License-Identifier: Apache-2.0
"""The stubs are what runs, by mypy's stubtest; parameters of the C++ module are compared in drive_test.py. Needs mypy (scripts/install-dependencies --python)."""
import os
import pathlib
import re
import shutil
import subprocess
import sys

import egosgm

RUNNING = pathlib.Path(egosgm.__file__).parents[1]
# What stubtest need not find in the stubs: how pybind11 makes classes, and what the package's own Python adds for people to read.
KNOWN = re.compile(r"is inconsistent, metaclass differs$|\.__init__ is inconsistent, stub does not have \*args parameter \"args\"$"
                   r"|\.(__match_args__|__signature__|__all__) is not present in stub$|^egosgm\._options failed to import\.")
CONFIGURATION = """[mypy]
[mypy-egosgm.__main__,egosgm.arguments,egosgm.bag.*,egosgm.calibration.*,egosgm.cpu_driver,egosgm.diagnostics.*,egosgm.drive,egosgm.evaluation.*,egosgm.flow_program,egosgm.geometry.*,egosgm.live,egosgm.matcher,egosgm.moving_objects,egosgm.program,egosgm.report,egosgm.sequences,egosgm.values,egosgm.video_program,egosgm.videos,egosgm.viewer]
ignore_errors = True
[mypy-cv2.*,PIL.*,matplotlib.*,tqdm.*,rerun.*,yaml.*]
ignore_missing_imports = True
"""


def differences(stubs, tmp_path):
    """Lines of stubtest about the package that runs and the stubs in a folder."""
    (tmp_path / "mypy.ini").write_text(CONFIGURATION)
    done = subprocess.run([sys.executable, "-B", "-m", "mypy.stubtest", "--concise", "--mypy-config-file", tmp_path / "mypy.ini", "egosgm"],
                          cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(RUNNING), "MYPYPATH": str(stubs)},
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    lines = done.stdout.splitlines()
    assert any("metaclass differs" in line for line in lines), done.stdout  # it did run
    return [line for line in lines if not KNOWN.search(line)]


def test_the_stubs_are_what_runs(tmp_path):
    """But for one name that is changed here, which is found."""
    shutil.copytree(RUNNING / "egosgm", tmp_path / "stubs/egosgm", ignore=shutil.ignore_patterns("*.so"))
    stub = tmp_path / "stubs/egosgm/__init__.pyi"
    text = stub.read_text()
    assert "    def under_way(self)" in text
    stub.write_text(text.replace("    def under_way(self)", "    def underway(self)"))
    assert differences(tmp_path / "stubs", tmp_path) == ["egosgm.Pipeline.under_way is not present in stub", "egosgm.Pipeline.underway is not present at runtime"]
    assert (RUNNING / "egosgm/py.typed").exists() and "    p2: int" in (RUNNING / "egosgm/_options.pyi").read_text()
