// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>

namespace egosgm::app {

/// Throws InvalidArgument, naming the option, unless `file` ends in .png or .svg, and as expect_new_file.
void require_plot_name(const std::string& option, const std::string& file);

/// Writes what the file's name asks for. REQUIRES: require_plot_name.
void write_plot(const std::string& file, const std::function<std::string()>& svg,
                const std::function<cv::Mat()>& picture);

}  // namespace egosgm::app
