// SPDX-License-Identifier: Apache-2.0
#pragma once

// Functions that pybind11 calls of some Pythons and others do not have: the part of another Python in the module is
// loaded, and never runs.
__asm__(
    ".weak PyObject_ClearManagedDict\n"
    ".weak PyObject_Vectorcall\n"
    ".weak PyObject_VisitManagedDict\n"
    ".weak PyThreadState_GetUnchecked\n"
    ".weak _PyThreadState_UncheckedGet\n");
