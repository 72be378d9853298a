// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "host/ocl/kernel.h"

namespace egosgm::ocl {

/// A stage has a name, which errors and timings tell, the program of a kernel file, and launches for images
/// of a size.
class Stage {
 public:
  /// `name`: a string literal. `pixels` of a work-item, PIXELS of the file: 1 or 16; 0: by the device.
  Stage(Context& context, const char* name, const char* file, shared::ImageSize size, int pixels = 0,
        Defines defines = {}, Joins joins = Joins::kYes)
      : context_(context), name_(name), size_(size), pixels_(pixels > 0 ? pixels : pixels_a_work_item(context)) {
    program_ = &enter().program(file, defines.set("PIXELS", pixels_), joins);
  }
  /// A stage of which `row_group` work-items share a row whose values build on one another (ROW_GROUP); 0: by the
  /// device.
  static Stage of_row_groups(Context& context, const char* name, const char* file, shared::ImageSize size,
                             int row_group, Defines defines = {}) {
    if (row_group == 0) row_group = ocl::row_group(context);
    Stage stage(context, name, file, size, row_group == 1 ? 16 : 1, defines.set("ROW_GROUP", row_group));
    stage.row_group_ = row_group;
    return stage;
  }

  /// For the constructors of its kernels.
  operator Program&() const { return *program_; }
  shared::ImageSize size() const { return size_; }
  int pixels() const { return pixels_; }
  int row_group() const { return row_group_; }

  /// Memory and commands belong to this stage from now on.
  Context& enter() {
    context_.enter(name_);
    return context_;
  }
  template <typename Kernel, typename... Args>
  void launch(Kernel& kernel, const Range& range, Args&&... args) {
    kernel(enter(), range, args...);
  }
  /// For each pixel of `views`. The kernel's first parameter is the size.
  template <typename Kernel, typename... Args>
  void launch_pixels(Kernel& kernel, int views, Args&&... args) {
    launch(kernel, every_pixels(context_, size_, pixels_, views), size_, args...);
  }
  /// A work-group for each row of `views`; the same.
  template <typename Kernel, typename... Args>
  void launch_rows(Kernel& kernel, int views, Args&&... args) {
    launch(kernel, group_a_row(size_, row_group_, views), size_, args...);
  }

 private:
  Context& context_;
  const char* name_;
  shared::ImageSize size_;
  int pixels_, row_group_ = 0;
  Program* program_;
};

}  // namespace egosgm::ocl
