// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <sstream>
#include <string>

namespace egosgm::vision {

/// The columns of objects.csv: the truth's and a run's.
inline constexpr const char* kObjectColumns =
    "frame,id,left,top,right,bottom,x_m,y_m,z_m,vx_m,vy_m,vz_m,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23";

/// A row of them, without its end. `next_from_current` moves the object's points to the next camera's frame.
template <typename Object>
std::string object_row(const std::string& frame, const Object& object, const Eigen::Isometry3d& next_from_current) {
  std::ostringstream row;
  row.precision(12);
  row << frame << ',' << object.id << ',' << object.left << ',' << object.top << ',' << object.right << ','
      << object.bottom;
  for (const double value : object.centre_m) row << ',' << value;
  for (const double value : object.velocity_m) row << ',' << value;
  for (int i = 0; i < 12; ++i) row << ',' << next_from_current(i / 4, i % 4);
  return row.str();
}

}  // namespace egosgm::vision
