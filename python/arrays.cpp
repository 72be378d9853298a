// SPDX-License-Identifier: Apache-2.0
#include "python/arrays.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::python {
namespace {

std::string shape_of(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i ? ", " : "") + std::to_string(array.shape(i));
  return text + ") of " + py::str(array.dtype()).cast<std::string>();
}

py::array as_array(const py::object& object, const std::string& name, const char* wanted) {
  py::array array = object.is_none() ? py::array() : py::array::ensure(object);
  if (object.is_none() || !array || array.ndim() == 0) {
    PyErr_Clear();
    throw InvalidArgument(name + " is no array: give " + wanted);
  }
  if (py::hasattr(object, "mask") && py::module_::import("numpy.ma").attr("is_masked")(object).cast<bool>()) {
    throw InvalidArgument(name +
                          " has a mask, which nobody looks at: give its filled(value), with "
                          "egosgm.INVALID_DISPARITY for the value where it is a disparity");
  }
  return array;
}

bool rows_are_contiguous(const py::array& array) {
  return array.shape(1) < 2 || array.strides(1) == element_bytes(array);
}

bool is_aligned(const py::array& array) { return array.attr("flags").attr("aligned").cast<bool>(); }

/// Rows that overlap, as broadcast ones do.
bool rows_overlap(const py::array& array) {
  return array.shape(0) > 1 && std::abs(array.strides(0)) < array.shape(1) * element_bytes(array);
}

/// A copy whose elements lie side by side and where their type wants them.
py::array contiguous(const py::array& array) {
  return py::module_::import("numpy").attr("require")(array, py::none(), "CA");
}

void expect_indexable(const py::array& array, const std::string& name) {
  for (py::ssize_t i = 0; i < array.ndim(); ++i) {
    if (array.shape(i) > std::numeric_limits<int>::max()) {
      throw InvalidArgument(name + " is " + shape_of(array) + ": give a smaller one");
    }
  }
}

py::array_t<double> doubles_of(const py::object& object, const char* name) {
  auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw InvalidArgument(std::string(name) + " is no array of numbers: give a 4x4 matrix");
  }
  return array;
}

Eigen::Isometry3d transform_at(const double* rows, int count, const char* name) {
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  for (int row = 0; row < count; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = rows[4 * row + column];
      if (!std::isfinite(value)) throw InvalidArgument(std::string(name) + " holds a value that is not finite");
      transform.matrix()(row, column) = value;
    }
  }
  return transform;
}

void store(const Eigen::Isometry3d& transform, double* to) {
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(to, 4, 4) = transform.matrix();
}

/// RGB as OpenCV weighs it; what is no image of whole numbers stays as it is.
py::array grey_of(const py::array& colour) {
  const bool bytes = colour.dtype().equal(py::dtype::of<std::uint8_t>());
  if ((!bytes && !colour.dtype().equal(py::dtype::of<std::uint16_t>())) || colour.size() == 0) return colour;
  const py::array packed = contiguous(colour);
  expect_indexable(packed, "image");
  const int height = static_cast<int>(packed.shape(0)), width = static_cast<int>(packed.shape(1)),
            channels = static_cast<int>(packed.shape(2));
  const vision::Image colors(height, width, {bytes ? vision::ChannelType::kU8 : vision::ChannelType::kU16, channels},
                             const_cast<void*>(packed.data()), static_cast<std::size_t>(packed.strides(0)));
  return array_of(channels == 1 ? colors : vision::grey_of_colors(colors, vision::ColorOrder::kRgb));
}

}  // namespace

py::ssize_t element_bytes(const py::array& array) { return array.attr("itemsize").cast<py::ssize_t>(); }

ImageArray image_of(const py::object& image, const char* name) {
  constexpr const char* kWanted = "a grey image, H x W of uint8 or uint16, or a colour one, H x W x 3 or 4, RGB";
  py::array array = as_array(image, name, kWanted);
  if (array.ndim() == 3 && (array.shape(2) == 3 || array.shape(2) == 4 || array.shape(2) == 1)) array = grey_of(array);
  const bool bytes = array.dtype().equal(py::dtype::of<std::uint8_t>());
  if (array.ndim() != 2 || (!bytes && !array.dtype().equal(py::dtype::of<std::uint16_t>()))) {
    throw InvalidArgument(std::string(name) + " is " + shape_of(array) + ": give " + kWanted);
  }
  expect_indexable(array, name);
  if (!rows_are_contiguous(array) || rows_overlap(array) || !is_aligned(array)) array = contiguous(array);
  const ImageView view{.data = array.data(),
                       .width = static_cast<int>(array.shape(1)),
                       .height = static_cast<int>(array.shape(0)),
                       .stride_bytes = array.strides(0),
                       .type = bytes ? PixelType::kU8 : PixelType::kU16};
  return {array, view};
}

vision::Image mat_of(const py::object& image, const char* name) {
  const ImageArray owner = image_of(image, name);
  const ImageView& view = owner.view;
  vision::Image mat(view.height, view.width, view.type == PixelType::kU8 ? vision::kU8 : vision::kU16);
  for (int y = 0; y < view.height; ++y) {
    std::memcpy(mat.row(y), static_cast<const char*>(view.data) + y * view.stride_bytes,
                static_cast<std::size_t>(view.width) * mat.type.pixel_bytes());
  }
  return mat;
}

vision::Image map_of(const py::object& map, const char* name, py::array& keep) {
  keep = as_array(map, name, "an H x W map of float32");
  if (keep.ndim() != 2 || keep.size() == 0) {
    throw InvalidArgument(std::string(name) + " is " + shape_of(keep) + ": give an H x W map of float32");
  }
  if (keep.dtype().equal(py::dtype::of<std::int16_t>())) {
    throw InvalidArgument(std::string(name) + " is " + shape_of(keep) +
                          ", which matchers of OpenCV's form give with 16 steps a pixel: give it divided by 16, as "
                          "float32, with egosgm.INVALID_DISPARITY where there is no disparity");
  }
  expect_indexable(keep, name);
  if (!keep.dtype().equal(py::dtype::of<float>())) {
    py::object floats = py::module_::import("numpy").attr("asarray")(keep, py::dtype::of<float>());
    keep = floats;
  }
  if (!rows_are_contiguous(keep) || !is_aligned(keep) || keep.strides(0) < keep.shape(1) * element_bytes(keep))
    keep = contiguous(keep);
  return vision::Image(static_cast<int>(keep.shape(0)), static_cast<int>(keep.shape(1)), vision::kF32,
                       const_cast<void*>(keep.data()), static_cast<std::size_t>(keep.strides(0)));
}

template <typename T>
MapView<T> output_of(const py::object& object, const std::string& name) {
  const std::string wanted =
      "give a writeable H x W array of " + py::str(py::dtype::of<T>()).cast<std::string>() + " with contiguous rows";
  if (!py::isinstance<py::array>(object)) throw InvalidArgument("output " + name + " is no NumPy array: " + wanted);
  auto array = py::reinterpret_borrow<py::array>(object);
  if (array.ndim() != 2 || !array.dtype().equal(py::dtype::of<T>()) || !array.writeable() ||
      !rows_are_contiguous(array) || rows_overlap(array) || !is_aligned(array)) {
    throw InvalidArgument("output " + name + " is " + shape_of(array) + (array.writeable() ? "" : ", read-only") +
                          ": " + wanted);
  }
  expect_indexable(array, "output " + name);
  return {static_cast<T*>(array.mutable_data()), static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
          array.strides(0)};
}
template MapView<float> output_of<float>(const py::object&, const std::string&);
template MapView<std::uint16_t> output_of<std::uint16_t>(const py::object&, const std::string&);
template MapView<std::uint8_t> output_of<std::uint8_t>(const py::object&, const std::string&);

py::array array_of(const vision::Image& mat) {
  if (!mat.owner && !mat.empty()) return array_of(mat.clone());  // memory of somebody else's
  const py::dtype type = mat.type.channel == vision::ChannelType::kU8    ? py::dtype::of<std::uint8_t>()
                         : mat.type.channel == vision::ChannelType::kU16 ? py::dtype::of<std::uint16_t>()
                                                                         : py::dtype::of<float>();
  const py::capsule owner(new vision::Image(mat), [](void* held) { delete static_cast<vision::Image*>(held); });
  const auto item = static_cast<py::ssize_t>(mat.type.channel_bytes());
  const auto step = static_cast<py::ssize_t>(mat.stride_bytes);
  if (mat.type.channels == 1) return py::array(type, {mat.rows, mat.cols}, {step, item}, mat.data, owner);
  if (mat.type == vision::kFlow)
    return py::array(type, {mat.rows, mat.cols, 2}, {step, 2 * item, item}, mat.data, owner);
  return py::array(type, {mat.rows, mat.cols, 3}, {step, 3 * item, -item}, mat.data + 2 * item, owner);  // BGR read RGB
}

Eigen::Isometry3d transform_of(const py::object& matrix, const char* name) {
  const py::array_t<double> values = doubles_of(matrix, name);
  if (values.ndim() != 2 || values.shape(1) != 4 || (values.shape(0) != 4 && values.shape(0) != 3)) {
    throw InvalidArgument(std::string(name) + " is " + shape_of(values) + ": give a 4x4 matrix [R t; 0 1]");
  }
  return transform_at(values.data(), static_cast<int>(values.shape(0)), name);
}

py::array_t<double> array_of(const Eigen::Isometry3d& transform) {
  py::array_t<double> array({4, 4});
  store(transform, array.mutable_data());
  return array;
}

std::vector<Isometry> transforms_of(const py::object& matrices, const char* name) {
  const py::array_t<double> values = doubles_of(matrices, name);
  if (values.ndim() != 3 || values.shape(1) != 4 || values.shape(2) != 4) {
    throw InvalidArgument(std::string(name) + " is " + shape_of(values) + ": give poses as an (N, 4, 4) array");
  }
  std::vector<Isometry> transforms;
  for (py::ssize_t i = 0; i < values.shape(0); ++i) transforms.push_back(transform_at(values.data(i), 4, name));
  return transforms;
}

py::array_t<double> array_of(const std::vector<Isometry>& transforms) {
  py::array_t<double> array({static_cast<py::ssize_t>(transforms.size()), py::ssize_t{4}, py::ssize_t{4}});
  for (std::size_t i = 0; i < transforms.size(); ++i) store(transforms[i], array.mutable_data() + 16 * i);
  return array;
}

}  // namespace egosgm::python
