// SPDX-License-Identifier: Apache-2.0
// NumPy's arrays and the library's views of the same memory.
#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Geometry>
#include <array>
#include <initializer_list>
#include <utility>
#include <vector>

#include "egosgm/image.h"
#include "egosgm/motion.h"
#include "egosgm/vision/image.h"

namespace egosgm::python {

namespace py = pybind11;

/// Asked of NumPy: the itemsize() of pybind11 before 2.12 does not know where NumPy 2 keeps it.
py::ssize_t element_bytes(const py::array& array);

/// A view, and what keeps its memory alive.
struct ImageArray {
  py::array array;
  ImageView view;
};

/// A grey image, H x W of uint8 or uint16, rows at any stride. Copied only where a row's pixels do not lie side by
/// side, rows overlap (broadcast ones) or pixels are not aligned. Throws InvalidArgument, naming the image.
ImageArray image_of(const py::object& image, const char* name);

/// A copy of such an image. Throws InvalidArgument.
vision::Image mat_of(const py::object& image, const char* name);

/// An H x W map of float32; other numbers, and rows that are not contiguous, are converted into a copy, which `keep`
/// holds. Throws InvalidArgument.
vision::Image map_of(const py::object& map, const char* name, py::array& keep);

/// A view for the library to fill. Throws InvalidArgument unless a writeable H x W array of T with contiguous rows.
template <typename T>
MapView<T> output_of(const py::object& object, const std::string& name);

/// The matrix's memory as an array, without a copy; colours as RGB.
py::array array_of(const vision::Image& mat);

/// A 4x4 (or 3x4) rigid transform. Throws InvalidArgument for another shape or values that are not finite.
Eigen::Isometry3d transform_of(const py::object& matrix, const char* name);
py::array_t<double> array_of(const Eigen::Isometry3d& transform);

/// An (N, 4, 4) array.
std::vector<Isometry> transforms_of(const py::object& matrices, const char* name);
py::array_t<double> array_of(const std::vector<Isometry>& transforms);

inline std::array<double, 3> values_of(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

/// [left, top, right, bottom] of an object's pixels.
template <typename Object>
std::array<int, 4> box_of(const Object& object) {
  return {object.left, object.top, object.right, object.bottom};
}

/// Makes a property of each of a class's images.
template <typename Value>
void bind_images(py::class_<Value>& bound,
                 std::initializer_list<std::pair<const char*, vision::Image Value::*>> images) {
  for (const auto& [name, member] : images) {
    bound.def_property_readonly(name, [member = member](const Value& value) { return array_of(value.*member); });
  }
}

}  // namespace egosgm::python
