// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "host/ocl/defines.h"
#include "host/ocl/opencl.h"

namespace egosgm::ocl {

/// Whether a kernel file may be built together with others. A program takes a compiler long whatever is in it; but all
/// of it is compiled anew where one define is another one.
enum class Joins { kYes, kNo };

/// A kernel file with its defines that a stage asked for. Context::build builds it, alone or with others.
class Program {
 public:
  /// `stage`: a string literal.
  Program(const char* stage, std::string file, Defines defines, Joins joins)
      : stage_(stage), file_(std::move(file)), defines_(std::move(defines)), joins_(joins) {}
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  const char* stage() const { return stage_; }
  const std::string& file() const { return file_; }
  const Defines& defines() const { return defines_; }
  Joins joins() const { return joins_; }

  bool is_built() const { return built_() != nullptr; }
  /// Calls `f` with the program: now where it is built, else then.
  void when_built(std::function<void(const cl::Program&)> f) {
    is_built() ? f(built_) : waiting_.push_back(std::move(f));
  }
  /// The program counts as not built if one of those that wait throws.
  void set_built(const cl::Program& built) {
    for (const auto& f : waiting_) f(built);
    waiting_.clear();
    built_ = built;
  }

 private:
  const char* stage_;
  std::string file_;
  Defines defines_;
  Joins joins_;
  cl::Program built_;
  std::vector<std::function<void(const cl::Program&)>> waiting_;
};

}  // namespace egosgm::ocl
