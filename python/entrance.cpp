// SPDX-License-Identifier: Apache-2.0
// Python enters a module with a part for each of several Pythons here: this calls the part of the one that runs.
#define Py_LIMITED_API 0x03090000
#include <Python.h>

#include <cstdio>

#define EGOSGM_FOR_EACH_PYTHON(DO) DO(9) DO(10) DO(11) DO(12) DO(13)

// Weak: a module has parts for those Pythons alone that it was built for.
#define EGOSGM_DECLARE(minor) extern "C" [[gnu::weak]] PyObject* egosgm_init_3_##minor();
EGOSGM_FOR_EACH_PYTHON(EGOSGM_DECLARE)

PyMODINIT_FUNC PyInit__egosgm() {
  int running = 0;
  std::sscanf(Py_GetVersion(), "3.%d", &running);
#define EGOSGM_ENTER(minor) \
  if (running == minor && egosgm_init_3_##minor != nullptr) return egosgm_init_3_##minor();
  EGOSGM_FOR_EACH_PYTHON(EGOSGM_ENTER)
  return PyErr_Format(PyExc_ImportError, "egosgm: the module was not built for Python %s", Py_GetVersion());
}
