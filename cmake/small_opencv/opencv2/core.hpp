// SPDX-License-Identifier: Apache-2.0
// What egosgm::vision takes of OpenCV's core: a matrix, points and vectors, with OpenCV's names and meanings. It stands
// in for OpenCV where EGOSGM_OPENCV is OFF: in the wheel, and where OpenCV is not installed. C++ programs that link
// egosgm::vision need OpenCV itself.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <type_traits>
#include <vector>

enum { CV_8U = 0, CV_16U = 2, CV_16S = 3, CV_32F = 5 };
constexpr int CV_MAKETYPE(int depth, int channels) { return depth + 8 * (channels - 1); }
constexpr int CV_MAT_DEPTH(int type) { return type % 8; }
constexpr std::size_t CV_ELEM_SIZE(int type) {
  return (CV_MAT_DEPTH(type) == CV_8U    ? 1u
          : CV_MAT_DEPTH(type) == CV_32F ? 4u
                                         : 2u) *
         static_cast<std::size_t>(type / 8 + 1);
}
constexpr int CV_8UC1 = CV_8U, CV_16UC1 = CV_16U, CV_16SC1 = CV_16S, CV_32FC1 = CV_32F;
constexpr int CV_8UC3 = CV_MAKETYPE(CV_8U, 3), CV_16UC3 = CV_MAKETYPE(CV_16U, 3);

namespace cv {

struct Size {
  int width = 0, height = 0;

  Size() = default;
  Size(int w, int h) : width(w), height(h) {}
  bool operator==(const Size&) const = default;
  bool empty() const { return width <= 0 || height <= 0; }
  int area() const { return width * height; }
};

template <typename T>
struct Point_ {
  T x = 0, y = 0;

  Point_() = default;
  Point_(T at_x, T at_y) : x(at_x), y(at_y) {}
  friend Point_ operator+(Point_ a, Point_ b) { return {static_cast<T>(a.x + b.x), static_cast<T>(a.y + b.y)}; }
};
using Point = Point_<int>;

struct Point3f {
  float x = 0, y = 0, z = 0;
};

struct Rect {
  int x = 0, y = 0, width = 0, height = 0;

  Rect(int left, int top, int w, int h) : x(left), y(top), width(w), height(h) {}
  Point br() const { return {x + width, y + height}; }
  friend Rect operator&(const Rect& a, const Rect& b) {
    const int left = std::max(a.x, b.x), top = std::max(a.y, b.y);
    return {left, top, std::max(0, std::min(a.br().x, b.br().x) - left),
            std::max(0, std::min(a.br().y, b.br().y) - top)};
  }
};

template <typename T, int n>
struct Vec {
  std::array<T, n> values{};

  Vec() = default;
  Vec(T a, T b, T c) : values{a, b, c} {}
  bool operator==(const Vec&) const = default;
  T& operator[](int i) { return values[static_cast<std::size_t>(i)]; }
  const T& operator[](int i) const { return values[static_cast<std::size_t>(i)]; }
};
using Vec3b = Vec<std::uint8_t, 3>;
using Vec3f = Vec<float, 3>;

struct Scalar {
  std::array<double, 4> values{};

  Scalar(double a) : values{a} {}  // NOLINT: as OpenCV's
  Scalar(double a, double b, double c) : values{a, b, c} {}
  explicit Scalar(const Vec3b& v) : values{double(v[0]), double(v[1]), double(v[2])} {}
  static Scalar all(double a) { return {a, a, a}; }
};

/// A half of IEEE 754.
struct float16_t {
  std::uint16_t bits = 0;

  operator float() const {  // NOLINT: as OpenCV's
    const int exponent = (bits >> 10) & 31, fraction = bits & 1023;
    const float size = exponent == 31  ? (fraction ? NAN : INFINITY)
                       : exponent == 0 ? std::ldexp(static_cast<float>(fraction), -24)
                                       : std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
    return bits >> 15 ? -size : size;
  }
};

/// Rounds to an even number, and cuts off what lies outside.
template <typename T>
T saturate_cast(double value) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(value);
  } else {
    return static_cast<T>(std::clamp(std::nearbyint(value), static_cast<double>(std::numeric_limits<T>::min()),
                                     static_cast<double>(std::numeric_limits<T>::max())));
  }
}

/// A matrix, or a part of one, or somebody else's memory. Copies share it.
class Mat {
 public:
  int rows = 0, cols = 0;
  std::uint8_t* data = nullptr;
  std::shared_ptr<std::uint8_t> u;  // null: the memory is somebody else's
  struct Step {
    std::size_t bytes = 0;
    operator std::size_t() const { return bytes; }  // NOLINT: as OpenCV's
    std::size_t operator[](int) const { return bytes; }
  } step;

  Mat() = default;
  Mat(int height, int width, int type) { create({width, height}, type); }
  Mat(Size size, int type) { create(size, type); }
  Mat(Size size, int type, const Scalar& value) : Mat(size, type) { setTo(value); }
  Mat(int height, int width, int type, const Scalar& value) : Mat(height, width, type) { setTo(value); }
  Mat(int height, int width, int type, void* memory, std::size_t row_bytes = 0)
      : rows(height), cols(width), data(static_cast<std::uint8_t*>(memory)), type_(type) {
    step.bytes = row_bytes > 0 ? row_bytes : static_cast<std::size_t>(width) * elemSize();
  }

  void create(Size wanted, int type) {
    if (data && wanted == size() && type == type_) return;
    rows = wanted.height, cols = wanted.width, type_ = type;
    step.bytes = static_cast<std::size_t>(cols) * elemSize();
    const std::size_t bytes = std::max<std::size_t>(1, step.bytes * static_cast<std::size_t>(rows));
    constexpr std::align_val_t kAlignment{64};
    u = {static_cast<std::uint8_t*>(::operator new(bytes, kAlignment)),
         [](std::uint8_t* memory) { ::operator delete (memory, std::align_val_t{64}); }};
    data = u.get();
  }
  void create(int height, int width, int type) { create({width, height}, type); }

  int type() const { return type_; }
  int depth() const { return type_ % 8; }
  int channels() const { return type_ / 8 + 1; }
  std::size_t elemSize1() const { return CV_ELEM_SIZE(depth()); }
  std::size_t elemSize() const { return CV_ELEM_SIZE(type_); }
  Size size() const { return {cols, rows}; }
  bool empty() const { return rows == 0 || cols == 0; }
  std::size_t total() const { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols); }
  bool isContinuous() const { return rows < 2 || step == static_cast<std::size_t>(cols) * elemSize(); }

  template <typename T = std::uint8_t>
  T* ptr(int y = 0) {
    return reinterpret_cast<T*>(data + static_cast<std::size_t>(y) * step);
  }
  template <typename T = std::uint8_t>
  const T* ptr(int y = 0) const {
    return reinterpret_cast<const T*>(data + static_cast<std::size_t>(y) * step);
  }
  template <typename T>
  T& at(int y, int x) {
    return ptr<T>(y)[x];
  }
  template <typename T>
  const T& at(int y, int x) const {
    return ptr<T>(y)[x];
  }
  template <typename T>
  T& at(Point p) {
    return ptr<T>(p.y)[p.x];
  }
  template <typename T>
  const T& at(Point p) const {
    return ptr<T>(p.y)[p.x];
  }

  /// REQUIRES: isContinuous().
  template <typename T>
  const T* begin() const {
    return ptr<T>();
  }
  template <typename T>
  const T* end() const {
    return ptr<T>() + total();
  }
  /// `act` gets a value and its row and column.
  template <typename T, typename Act>
  void forEach(const Act& act) {
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < cols; ++x) {
        const int at_yx[] = {y, x};
        act(at<T>(y, x), at_yx);
      }
    }
  }

  Mat operator()(const Rect& part) const {
    Mat mat = *this;
    mat.data += static_cast<std::size_t>(part.y) * step + static_cast<std::size_t>(part.x) * elemSize();
    mat.rows = part.height, mat.cols = part.width;
    return mat;
  }
  Mat clone() const {
    Mat mat;
    copyTo(mat);
    return mat;
  }
  void copyTo(Mat& to) const {
    to.create(size(), type_);
    for (int y = 0; y < rows; ++y) std::memcpy(to.ptr(y), ptr(y), static_cast<std::size_t>(cols) * elemSize());
  }
  void copyTo(Mat&& part) const { copyTo(part); }
  /// Where the mask, CV_8UC1, is not 0. REQUIRES: `to` has the same size and type.
  void copyTo(Mat& to, const Mat& mask) const {
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < cols; ++x) {
        if (mask.at<std::uint8_t>(y, x)) std::memcpy(to.ptr(y) + x * elemSize(), ptr(y) + x * elemSize(), elemSize());
      }
    }
  }
  void push_back(const Mat& below) {
    Mat mat(rows + below.rows, cols, type_);
    copyTo(mat(Rect(0, 0, cols, rows)));
    below.copyTo(mat(Rect(0, rows, cols, below.rows)));
    *this = mat;
  }

  Mat& setTo(const Scalar& value) { return setTo(value, Mat()); }
  Mat& setTo(const Scalar& value, const Mat& mask) {
    visit([&]<typename T>(T) {
      for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < cols; ++x) {
          if (!mask.empty() && mask.at<std::uint8_t>(y, x) == 0) continue;
          for (int c = 0; c < channels(); ++c) {
            ptr<T>(y)[x * channels() + c] = saturate_cast<T>(value.values[static_cast<std::size_t>(c)]);
          }
        }
      }
    });
    return *this;
  }

  /// As the depth of `type`, value * scale + shift.
  void convertTo(Mat& to, int type, double scale = 1, double shift = 0) const {
    Mat result(size(), CV_MAKETYPE(type % 8, channels()));
    visit([&]<typename T>(T) {
      result.visit([&]<typename To>(To) {
        for (int y = 0; y < rows; ++y) {
          for (int i = 0; i < cols * channels(); ++i) {
            result.ptr<To>(y)[i] = saturate_cast<To>(ptr<T>(y)[i] * scale + shift);
          }
        }
      });
    });
    to = result;
  }

  /// 255 where `which` of a value is so, else 0. REQUIRES: one channel.
  template <typename Which>
  Mat where(const Which& which) const {
    Mat mask(size(), CV_8UC1);
    visit([&]<typename T>(T) {
      for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < cols; ++x) mask.at<std::uint8_t>(y, x) = which(at<T>(y, x)) ? 255 : 0;
      }
    });
    return mask;
  }
  friend Mat operator==(const Mat& mat, double value) {
    return mat.where([&](auto other) { return static_cast<double>(other) == value; });
  }
  friend Mat operator<=(const Mat& mat, double value) {
    return mat.where([&](auto other) { return static_cast<double>(other) <= value; });
  }
  friend Mat operator>(const Mat& mat, double value) {
    return mat.where([&](auto other) { return static_cast<double>(other) > value; });
  }

 private:
  template <typename Do>
  void visit(const Do& act) const {
    if (depth() == CV_8U) return act(std::uint8_t{});
    if (depth() == CV_16U) return act(std::uint16_t{});
    if (depth() == CV_16S) return act(std::int16_t{});
    act(float{});
  }

  int type_ = 0;
};

inline void vconcat(const Mat& above, const Mat& below, Mat& both) {
  Mat mat = above.clone();
  mat.push_back(below);
  both = mat;
}

}  // namespace cv
