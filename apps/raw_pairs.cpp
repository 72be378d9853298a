// SPDX-License-Identifier: Apache-2.0
#include "apps/raw_pairs.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>

#include "apps/counted.h"
#include "apps/media.h"
#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "host/vision/file_io.h"
#include "host/vision/image_pairs.h"
#include "host/vision/text_rows.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxListBytes = std::size_t{1} << 28;

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension;
}

/// Whether it is named as what only OpenCV reads.
bool is_foreign(const fs::path& file) {
  static const std::array<const char*, 6> extensions{".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"};
  return std::find(extensions.begin(), extensions.end(), lower_extension(file)) != extensions.end();
}

/// For OpenCV, which would wait for a pipe without an end.
void expect_file(const fs::path& file) {
  if (!fs::exists(file)) throw MissingPath(file.string(), "no such file");
  if (!fs::is_regular_file(file)) throw InvalidArgument(file.string() + ": is no file; give an image or a video");
}

cv::Mat read_image(const fs::path& file) {
  if (!is_foreign(file)) return vision::read_stored_image(file);
  expect_file(file);
  cv::Mat image = media().read_image(file.string(), cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
  if (image.empty() || (image.depth() != CV_8U && image.depth() != CV_16U)) {
    throw InvalidArgument(file.string() + ": cannot be read as an image of 8 or 16 bits");
  }
  return image;
}

class Files : public ImageSource {
 public:
  explicit Files(std::vector<fs::path> files) : files_(std::move(files)) {}
  cv::Mat next() override { return at_ < files_.size() ? read_image(files_[at_++]) : cv::Mat(); }
  std::optional<double> time_s() const override { return std::nullopt; }
  int count() const override { return static_cast<int>(files_.size()); }

 private:
  const std::vector<fs::path> files_;
  std::size_t at_ = 0;
};

class Video : public ImageSource {
 public:
  explicit Video(const std::string& file) : file_(file) {
    expect_file(file);
    video_ = media().open_video(file);
    if (!video_) throw InvalidArgument(file + ": neither an image nor a video that OpenCV can read");
  }
  cv::Mat next() override {
    cv::Mat image;
    const double rate = video_->get(cv::CAP_PROP_FPS);
    if (!video_->read(image)) return {};
    time_s_ = rate > 0 ? std::optional<double>(number_ / rate) : std::nullopt;
    ++number_;
    return image;
  }
  std::optional<double> time_s() const override { return time_s_; }
  int count() const override { return static_cast<int>(video_->get(cv::CAP_PROP_FRAME_COUNT)); }

 private:
  const std::string file_;
  std::unique_ptr<cv::VideoCapture> video_;
  std::optional<double> time_s_;
  int number_ = 0;
};

void require_same_size(const RawPair& pair, const std::string& what) {
  if (pair.left.size() == pair.right.size() && pair.left.depth() == pair.right.depth()) return;
  throw InvalidArgument(fmt::format("{}: the left image is {}x{}, the right one {}x{}: both need one size and depth",
                                    what, pair.left.cols, pair.left.rows, pair.right.cols, pair.right.rows));
}

class TwoSources : public RawPairs {
 public:
  TwoSources(const std::string& left, const std::string& right)
      : name_(left), right_name_(right), left_(open_images(left)), right_(open_images(right)) {
    if (left_->count() < 0 || right_->count() < 0 || left_->count() == right_->count()) return;
    throw InvalidArgument(fmt::format("--left {} has {} images, --right {} has {}: give as many of both", left,
                                      left_->count(), right, right_->count()));
  }
  std::optional<RawPair> next() override {
    RawPair pair{left_->next(), right_->next(), left_->time_s()};
    if (pair.left.empty() || pair.right.empty()) {
      if (!pair.left.empty()) note_ = text_of_early_end("--right " + right_name_, "--left " + name_);
      if (!pair.right.empty()) note_ = text_of_early_end("--left " + name_, "--right " + right_name_);
      return std::nullopt;
    }
    require_same_size(pair, name_);
    ++pairs_;
    return pair;
  }
  int count() const override { return left_->count(); }
  std::string note() const override { return note_; }

 private:
  std::string text_of_early_end(const std::string& ended, const std::string& longer) const {
    return fmt::format("{} ends after {}, before {}: the rest of that one is left out", ended, counted(pairs_, "image"),
                       longer);
  }

  const std::string name_, right_name_;
  const std::unique_ptr<ImageSource> left_, right_;
  std::size_t pairs_ = 0;
  std::string note_;
};

class SideBySide : public RawPairs {
 public:
  explicit SideBySide(const std::string& pattern) : name_(pattern), images_(open_images(pattern)) {}
  std::optional<RawPair> next() override {
    const cv::Mat both = images_->next();
    if (both.empty()) return std::nullopt;
    if (both.cols % 2 != 0) {
      throw InvalidArgument(
          fmt::format("--side-by-side {}: the images are {} px wide, which has no half", name_, both.cols));
    }
    const int width = both.cols / 2;
    return RawPair{both.colRange(0, width), both.colRange(width, both.cols), images_->time_s()};
  }
  int count() const override { return images_->count(); }

 private:
  const std::string name_;
  const std::unique_ptr<ImageSource> images_;
};

struct ListedPair {
  fs::path left, right;
  std::optional<double> time_s;
};

class Listed : public RawPairs {
 public:
  Listed(std::vector<ListedPair> pairs, std::string note) : pairs_(std::move(pairs)), note_(std::move(note)) {}
  std::optional<RawPair> next() override {
    if (at_ == pairs_.size()) return std::nullopt;
    const ListedPair& listed = pairs_[at_++];
    RawPair pair{read_image(listed.left), read_image(listed.right), listed.time_s};
    require_same_size(pair, listed.right.string());
    return pair;
  }
  int count() const override { return static_cast<int>(pairs_.size()); }
  std::string note() const override { return note_; }

 private:
  const std::vector<ListedPair> pairs_;
  const std::string note_;
  std::size_t at_ = 0;
};

/// Files of equal names; those without a partner are left out, with a note.
std::unique_ptr<RawPairs> open_file_pairs(const RawPairArguments& arguments) {
  vision::ImagePairs found = vision::find_pairs(arguments.left, arguments.right, arguments.pair_by);
  if (found.pairs.empty()) {
    throw InvalidArgument(fmt::format("--left {} --right {}: no file matches both", arguments.left, arguments.right));
  }
  if (found.alone.size() > 2 * found.pairs.size()) {
    throw InvalidArgument(
        fmt::format("--left {} --right {}: only {} of equal names, {} without, {} say: give --pair-by "
                    "order where order tells, or other patterns",
                    arguments.left, arguments.right, counted(found.pairs.size(), "pair"),
                    counted(found.alone.size(), "image"), found.alone.front().string()));
  }
  std::vector<ListedPair> pairs;
  for (auto& [left, right] : found.pairs) pairs.push_back({std::move(left), std::move(right), std::nullopt});
  return std::make_unique<Listed>(
      std::move(pairs), found.alone.empty()
                            ? ""
                            : fmt::format("{} without the other camera's left out, the first is {}",
                                          counted(found.alone.size(), "image"), found.alone.front().string()));
}

/// Rows LEFT RIGHT [SECONDS]; paths from the list's folder on.
std::unique_ptr<RawPairs> open_list(const fs::path& file) {
  const std::string text = vision::read_file(file, kMaxListBytes);
  std::vector<ListedPair> pairs;
  for (const vision::TextRow& row : vision::split_rows(text, file)) {
    std::istringstream words(std::string(vision::without_comment(row.text)));
    std::string left, right, time, more;
    if (!(words >> left)) continue;
    words >> right >> time;
    const std::optional<double> seconds = vision::parse_number(time);
    const bool is_time = time.empty() || (seconds && std::isfinite(*seconds));
    if (right.empty() || !is_time || words >> more) {
      vision::refuse_row(file, row.number, "give LEFT RIGHT or LEFT RIGHT SECONDS");
    }
    pairs.push_back({file.parent_path() / left, file.parent_path() / right, seconds});
  }
  if (pairs.empty()) throw InvalidArgument(file.string() + ": lists no pair");
  return std::make_unique<Listed>(std::move(pairs), "");
}

/// Nanoseconds -> file, of a camera's data.csv.
std::map<std::int64_t, fs::path> euroc_images(const fs::path& camera) {
  const fs::path file = camera / "data.csv";
  const std::string text = vision::read_file(file, kMaxListBytes);
  std::map<std::int64_t, fs::path> images;
  for (const vision::TextRow& row : vision::split_rows(text, file)) {
    if (vision::trim(row.text).empty() || row.text.starts_with('#')) continue;
    const std::size_t comma = std::min(row.text.find(','), row.text.size());
    const std::string_view name = vision::trim(row.text.substr(std::min(comma + 1, row.text.size())));
    const std::string_view time = vision::trim(row.text.substr(0, comma));
    std::int64_t time_ns = 0;
    const auto [end, error] = std::from_chars(time.data(), time.data() + time.size(), time_ns);
    const bool is_header = images.empty() && !time.empty() && (time.front() < '0' || time.front() > '9');
    if (is_header) continue;
    if (name.empty() || error != std::errc() || end != time.data() + time.size()) {
      vision::refuse_row(file, row.number, vision::quoted(row.text) + " is not TIME,FILE");
    }
    images[time_ns] = camera / "data" / name;
  }
  return images;
}

std::unique_ptr<RawPairs> open_euroc(const fs::path& mav0) {
  const auto left = euroc_images(mav0 / "cam0"), right = euroc_images(mav0 / "cam1");
  std::vector<ListedPair> pairs;
  constexpr std::int64_t kMaxSkew_ns = 2'000'000;  // cameras that are triggered together
  std::int64_t largest_ns = 0, nearest_ns = std::numeric_limits<std::int64_t>::max();
  const auto nearest = [](const auto& images, std::int64_t time_ns) {
    const auto after = images.lower_bound(time_ns);
    if (after == images.begin()) return after;
    const auto before = std::prev(after);
    return after == images.end() || time_ns - before->first <= after->first - time_ns ? before : after;
  };
  for (const auto& [time_ns, file] : left) {
    const auto other = nearest(right, time_ns);
    if (other == right.end() || nearest(left, other->first)->first != time_ns) continue;
    const std::int64_t apart_ns = std::abs(other->first - time_ns);
    if (apart_ns > kMaxSkew_ns) {
      nearest_ns = std::min(nearest_ns, apart_ns);
      continue;
    }
    largest_ns = std::max(largest_ns, apart_ns);
    const double seconds = 1e-9 * static_cast<double>(time_ns - left.begin()->first);
    pairs.push_back({file, other->second, seconds});
  }
  if (pairs.empty()) {
    throw InvalidArgument(
        mav0.string() + ": cam0 and cam1 have no time stamp in common" +
        (nearest_ns < std::numeric_limits<std::int64_t>::max()
             ? fmt::format("; the nearest are {:.3f} ms apart, at most {} ms are paired: --left, --right and --pair-by "
                           "order pair the images as they come",
                           1e-6 * static_cast<double>(nearest_ns), kMaxSkew_ns / 1'000'000)
             : ""));
  }
  const std::size_t alone = left.size() + right.size() - 2 * pairs.size();
  return std::make_unique<Listed>(
      std::move(pairs),
      (alone > 0 ? fmt::format("{} without the other one left out", counted(alone, "image")) : "") +
          (largest_ns == 0 ? ""
                           : fmt::format("{}stamps of a pair differ by up to {:.3f} ms", alone > 0 ? "; " : "",
                                         1e-6 * static_cast<double>(largest_ns))));
}

/// Whether it names images, by a pattern or an image's extension; else it is a video.
bool names_files(const std::string& pattern) {
  if (fs::path(pattern).filename().string().find_first_of("*%") != std::string::npos) return true;
  const std::string extension = lower_extension(pattern);
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg" || is_foreign(pattern);
}

}  // namespace

std::unique_ptr<ImageSource> open_images(const std::string& pattern) {
  if (!names_files(pattern)) return std::make_unique<Video>(pattern);
  std::vector<fs::path> files = vision::find_images(pattern);
  if (files.empty()) throw InvalidArgument(pattern + ": no file matches");
  return std::make_unique<Files>(std::move(files));
}

std::unique_ptr<RawPairs> open_pairs(const RawPairArguments& arguments) {
  const bool two = !arguments.left.empty() || !arguments.right.empty();
  const int sources = two + !arguments.side_by_side.empty() + !arguments.list.empty() + !arguments.euroc.empty();
  if (sources != 1 || (two && (arguments.left.empty() || arguments.right.empty()))) {
    throw InvalidArgument(std::string(sources == 0  ? "no input"
                                      : sources > 1 ? "more than one input"
                                                    : "half a pair") +
                          ": give --left and --right, or --side-by-side, or --list, or --euroc");
  }
  if (two && names_files(arguments.left) && names_files(arguments.right)) return open_file_pairs(arguments);
  if (two) return std::make_unique<TwoSources>(arguments.left, arguments.right);
  if (!arguments.side_by_side.empty()) return std::make_unique<SideBySide>(arguments.side_by_side);
  if (!arguments.list.empty()) return open_list(arguments.list);
  return open_euroc(arguments.euroc);
}

}  // namespace egosgm::app
