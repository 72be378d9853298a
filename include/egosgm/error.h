// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "egosgm/export.h"

namespace egosgm {

/// The base of all errors of this library: `catch (const egosgm::Error& error)` catches each of them. Each is a
/// std::exception, too.
class EGOSGM_EXPORT Error {
 public:
  virtual ~Error() = default;
  virtual const char* what() const noexcept = 0;
};

/// The caller gave something that cannot be used: an image, a calibration, an option, a file. `what()` names the
/// value and the remedy in one line. Nothing was enqueued and nothing was written.
class EGOSGM_EXPORT InvalidArgument : public std::invalid_argument, public Error {
 public:
  using std::invalid_argument::invalid_argument;
  const char* what() const noexcept override { return std::invalid_argument::what(); }
};

/// A file or folder that was named is not there.
class EGOSGM_EXPORT MissingPath : public InvalidArgument {
 public:
  /// `what()` is `path`, a colon and `reason`.
  MissingPath(std::string path, const std::string& reason)
      : InvalidArgument(path + ": " + reason), path_(std::move(path)) {}
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// The file system refused to take a result: a full disk, a folder that cannot be written. `what()` names the file and
/// the system's reason in one line. What stood under the file's name before stands there still.
class EGOSGM_EXPORT IoError : public std::runtime_error, public Error {
 public:
  using std::runtime_error::runtime_error;
  const char* what() const noexcept override { return std::runtime_error::what(); }
};

/// The device or its driver refused. `code()` is the OpenCL status, `what()` names the stage.
class EGOSGM_EXPORT DeviceError : public std::runtime_error, public Error {
 public:
  DeviceError(int code, const std::string& what) : std::runtime_error(what), code_(code) {}
  const char* what() const noexcept override { return std::runtime_error::what(); }
  int code() const { return code_; }

 private:
  int code_;
};

/// A kernel did not compile. `what()` ends with the compiler's log.
class EGOSGM_EXPORT BuildError : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

}  // namespace egosgm
