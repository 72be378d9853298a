# SPDX-License-Identifier: Apache-2.0
"""Kernels of the way that CPUs and FPGAs take hold to what FPGA compilers accept (docs/understand/fpga.md), read off clang's syntax tree.

EGOSGM_CLANG names clang.
"""
import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

CLANG = os.environ["EGOSGM_CLANG"]
KERNELS = pathlib.Path(__file__).resolve().parents[1] / "kernels"
GPU_WAY = {"banded_sgm_paths.cl"}
GPU_DEFINES = {"ROW_GROUP=64", "ROW_GROUP=128", "PIXELS=1"}

# Loops that end by what they read and not by a counter. Union-find: parents[run] <= run, so a walk to the root goes down, and a join
# that another work-item forestalled goes on with smaller runs. Stages that have them can be switched off (docs/understand/fpga.md).
# Those of banded_sgm.cl go along a row by a counter that is a member of a struct: its bound is known when they begin.
DATA_DEPENDENT = {"speckle_removal.cl": {"root_of", "root_now", "join_seams", "measure_row"}, "banded_sgm.cl": {"sweep_row", "match_straight"}}


def children(node):
    return [child for child in node.get("inner", []) if child]


def walk(node):
    yield node
    for child in children(node):
        yield from walk(child)


def type_of(node):
    kind = node.get("type", {})
    return kind.get("desugaredQualType", kind.get("qualType", ""))


def plain(node):
    """Without casts and parentheses."""
    while node.get("kind") in ("ImplicitCastExpr", "ParenExpr", "CStyleCastExpr") and children(node):
        node = children(node)[-1]
    return node


def variable(node):
    node = plain(node)
    return node.get("referencedDecl", {}).get("id") if node.get("kind") == "DeclRefExpr" else None


def changes(node):
    """(variable, how) of every assignment in `node`."""
    for inner in walk(node):
        kind, how = inner.get("kind"), inner.get("opcode", "")
        if kind == "UnaryOperator" and how in ("++", "--"):
            yield variable(children(inner)[0]), how
        elif kind == "CompoundAssignOperator" or (kind == "BinaryOperator" and how == "="):
            yield variable(children(inner)[0]), how


def comparisons(condition):
    condition = plain(condition)
    if condition.get("opcode") in ("&&", "||"):
        if condition["opcode"] == "||":
            return []
        return [found for side in children(condition) for found in comparisons(side)]
    return [condition] if condition.get("opcode") in ("<", "<=", ">", ">=", "!=") else []


def counters(side):
    """Variables of a side of a comparison: i, or i + 16; not p[i], whose value no step of i bounds."""
    side = plain(side)
    if side.get("kind") == "BinaryOperator" and side.get("opcode") in ("+", "-"):
        return set().union(*(counters(part) for part in children(side)))
    return {variable(side)} - {None}


def is_counted(loop):
    """A variable goes one way by steps to a bound that stays; or bits are cleared until none is left."""
    parts = loop["inner"]  # of a for: initialisation, declaration, condition, increment, body; some may be empty
    condition, rest = (parts[2], parts[3:]) if loop["kind"] == "ForStmt" else (parts[0], parts[1:])
    if loop["kind"] == "DoStmt" or not condition:
        return False
    changed = [change for part in rest if part for change in changes(part)]
    for comparison in comparisons(condition):
        left, right = children(comparison)
        for counter, bound in ((left, right), (right, left)):
            steps = [how for name, how in changed if name is not None and name in counters(counter)]
            bound_moves = {variable(node) for node in walk(bound)} & {name for name, _ in changed if name is not None}
            if steps and not bound_moves and len(set(steps)) == 1 and steps[0] in ("++", "--", "+=", "-=", "*=", "/=", ">>=", "&="):
                return True
    return False


def functions(tree):
    for node in children(tree):
        if node.get("kind") == "FunctionDecl" and any(child.get("kind") == "CompoundStmt" for child in children(node)):
            yield node


def calls(function):
    return {plain(children(node)[0]).get("referencedDecl", {}).get("name", "")
            for node in walk(function) if node.get("kind") == "CallExpr"}


def recursive(all_functions):
    calls_of = {function["name"]: calls(function) for function in all_functions}
    found = set()
    for start in calls_of:
        reached, front = set(), set(calls_of[start])
        while front:
            reached |= front
            front = {callee for at in front for callee in calls_of.get(at, ())} - reached
        if start in reached:
            found.add(start)
    return found


def violations(tree, data_dependent=frozenset()):
    """What FPGA compilers do not take, a line each."""
    own = list(functions(tree))
    recurring = recursive(own)
    loops_found = set()
    for function in own:
        name = function["name"]
        if name in recurring:
            yield f"{name}: recursion"
        for node in walk(function):
            kind, kind_of_type = node.get("kind"), type_of(node)
            if kind in ("VarDecl", "ParmVarDecl") and re.search(r"\*\s*((const|volatile|restrict|__\w+)\s*)*\*", kind_of_type):
                yield f"{name}: pointer to pointer {kind_of_type}"
            if kind in ("ForStmt", "WhileStmt", "DoStmt") and not is_counted(node):
                loops_found.add(name)
                if name not in data_dependent:
                    yield f"{name}: a loop that no counter bounds"
            if kind in ("GotoStmt", "IndirectGotoStmt"):
                yield f"{name}: goto"
            if kind == "VarDecl" and "(*" in kind_of_type:
                yield f"{name}: pointer to a function or an array {kind_of_type}"
            if kind == "VarDecl" and re.search(r"\[[^\]0-9]*\]", kind_of_type):
                yield f"{name}: an array without a fixed size {kind_of_type}"
            if re.search(r"\b(double\d*|image\dd\w*|pipe)\b", kind_of_type):
                yield f"{name}: {kind_of_type}"
            if kind == "CallExpr":
                callee = plain(children(node)[0]).get("referencedDecl", {}).get("name", "")
                wide = any(re.search(r"\b(long|ulong)\b[^,]*\*", type_of(argument)) for argument in children(node)[1:])
                if callee.startswith("atom_") or (callee.startswith("atomic_") and wide):
                    yield f"{name}: 64-bit atomic {callee}"
                if not callee:
                    yield f"{name}: a call by pointer"
    for name in sorted(set(data_dependent) - loops_found):
        yield f"{name}: all its loops are counted now: take it off DATA_DEPENDENT"


def syntax_tree(file, defines=()):
    command = [CLANG, "-x", "cl", "-cl-std=CL1.2", "-target", "spir64-unknown-unknown", "-Xclang", "-finclude-default-header", "-Xclang",
               "-fdeclare-opencl-builtins", "-I", str(KERNELS), "-I", str(KERNELS / "sgm"), "-I", str(KERNELS / "stages"), *(f"-D{define}" for define in defines), "-Wno-everything", "-Xclang",
               "-ast-dump=json", "-fsyntax-only", str(file)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=900).stdout)


def variants(kernel):
    """The sets of defines that its file names, without those that only GPUs get."""
    lines = re.findall(r"^// lint: (.*)$", kernel.read_text(), re.MULTILINE) or [""]
    return [line.split() for line in lines if not GPU_DEFINES & set(line.split())]


class Rules(unittest.TestCase):
    """Each rule finds what it is for, and leaves alone what it is not for."""

    def found(self, source):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "kernel.cl"
            file.write_text(source)
            return list(violations(syntax_tree(file)))

    def test_counted_loops_pass(self):
        for loop in ("for (int i = 0; i < n; ++i) p[i] = i;", "for (int i = n; i > 0; i -= 2) p[i] = i;",
                     "int i = 0; while (i < n) { p[i] = 1; i += 4; }", "for (uint b = n; b != 0; b &= b - 1) p[0] += b;",
                     "for (int i = 0; n > 3 && i < n; i++) p[i] = i;", "for (int s = 1; s < n; s *= 2) p[s] = s;"):
            self.assertEqual(self.found(f"kernel void k(int n, global int* p) {{ {loop} }}"), [], loop)

    def test_others_do_not(self):
        for loop in ("while (p[n] != n) n = p[n];", "while (true) if (p[0]) break;", "for (;;) if (p[0]) break;",
                     "for (int i = 0; i < n; ++i) ++n;", "for (int i = 0; i < n; ++i) i -= p[i];", "for (int i = 0; p[i] < n; ++i) {}",
                     "do { ++n; } while (n < p[0]);", "for (int i = n; p[i] != i; i = p[i]) {}"):
            self.assertEqual(len(self.found(f"kernel void k(int n, global int* p) {{ {loop} }}")), 1, loop)

    def test_what_else_is_refused(self):
        for source, named in (("void f(int** p) { **p = 0; }", "pointer to pointer"),
                              ("kernel void k(global int* p) { global int* a = p; global int** b = &a; **b = 0; }", "pointer to pointer"),
                              ("int f(int n) { return n ? f(n - 1) : 0; }", "recursion"),
                              ("int g(int n); int f(int n) { return g(n); } int g(int n) { return n ? f(n - 1) : 0; }", "recursion"),
                              ("kernel void k(global int* p) { again: if (*p) goto again; }", "goto"),
                              ("kernel void k(volatile global long* p) { atom_max(p, 1l); }", "64-bit atomic"),
                              ("kernel void k(read_only image2d_t p, global float* q) { *q = get_image_width(p); }", "image2d_t")):
            pragma = "#pragma OPENCL EXTENSION cl_khr_int64_extended_atomics : enable\n"
            found = self.found(pragma + source)
            self.assertTrue(any(named in line for line in found), f"{source}: {found}")

    def test_what_is_allowed(self):
        for source in ("kernel void k(volatile global uint* p) { atomic_max(p, 1u); }",
                       "kernel void k(global int* p) { int t[4][8]; for (int i = 0; i < 8; ++i) t[i & 3][i] = p[i]; p[0] = t[0][p[1]]; }",
                       "int f(int* p) { return *p; } kernel void k(global int* p) { int a = 1; p[0] = f(&a); }"):
            self.assertEqual(self.found(source), [], source)


class Kernels(unittest.TestCase):
    def test_hold_to_the_rules(self):
        checked = 0
        for kernel in sorted(KERNELS.glob("*/*.cl")):
            if kernel.name in GPU_WAY:
                continue
            chosen = variants(kernel)
            self.assertTrue(chosen, f"{kernel.name} names no defines of the CPUs' and FPGAs' way")
            for defines in chosen:
                checked += 1
                with self.subTest(kernel=kernel.name, defines=defines):
                    self.assertEqual(list(violations(syntax_tree(kernel, defines), DATA_DEPENDENT.get(kernel.name, ()))), [])
        self.assertGreater(checked, 20)
