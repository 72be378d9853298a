// SPDX-License-Identifier: Apache-2.0
#include "vision/file_kinds.h"

#include <algorithm>
#include <fstream>
#include <regex>
#include <string>
#include <system_error>

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = std::size_t{1} << 20;

/// The start of a regular file; empty of anything else.
std::string start_of(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return {};
  std::ifstream stream(path, std::ios::binary);
  std::string text(kMaxBytes, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, stream.gcount())));
  return text;
}

bool is_named_as_bag(fs::path path) {
  if (path.extension() == ".zstd") path = path.stem();
  const fs::path extension = path.extension();
  return extension == ".bag" || extension == ".mcap" || extension == ".db3";
}

}  // namespace

bool is_bag(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return is_named_as_bag(path);
  if (start_of(path / "metadata.yaml").find("rosbag2_bagfile_information") != std::string::npos) return true;
  bool has_bag = false;
  for (auto entry = fs::directory_iterator(path, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (entry->is_directory(error)) return false;
    has_bag = has_bag || is_named_as_bag(entry->path());
  }
  return has_bag;
}

bool is_own_calibration(const fs::path& path) {
  static const std::regex kRow(R"((^|\n)[ \t]*(P_rect_\d|P[0-3][ \t]*:(?![ \t]*!!)|cam0[ \t]*=|baseline_m\b))");
  const std::string text = start_of(path);
  const bool is_text = text.find('\0') == std::string::npos;  // an archive may hold one as it is
  return is_text && !text.starts_with("%YAML") && std::regex_search(text, kRow);
}

}  // namespace egosgm::vision
