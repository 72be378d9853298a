// SPDX-License-Identifier: Apache-2.0
// PNG as cameras' programs and this one write it: grey of 8 or 16 bits or RGB of 8, not interlaced, without a palette.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace egosgm::vision {

/// The pixels as stored, of a file whose header says `size`; nothing where it is not plain, or not whole: libpng reads
/// the former and says what is wrong with the latter. Several times as fast as libpng.
/// REQUIRES: bytes that parse_png_size took, and `size` of it.
std::optional<cv::Mat> decode_plain_png(std::string_view bytes, cv::Size size, const std::filesystem::path& file);

/// A file with these pixels. REQUIRES: CV_8UC1, CV_8UC3 (BGR) or CV_16UC1, not empty.
std::string encode_plain_png(const cv::Mat& image);

}  // namespace egosgm::vision
