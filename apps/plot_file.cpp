// SPDX-License-Identifier: Apache-2.0
#include "apps/plot_file.h"

#include <filesystem>

#include "apps/output_folder.h"
#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "host/vision/file_io.h"

namespace egosgm::app {

void require_plot_name(const std::string& option, const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension();
  if (extension != ".svg" && extension != ".png") {
    throw InvalidArgument(option + " " + file + ": the name must end in .png or .svg");
  }
  expect_new_file(option, file);
}

void write_plot(const std::string& file, const std::function<std::string()>& svg,
                const std::function<cv::Mat()>& picture) {
  const vision::KeepFiles others;
  if (std::filesystem::path(file).extension() == ".svg") {
    vision::write_file(file, svg());
  } else {
    vision::write_png(file, picture());
  }
}

}  // namespace egosgm::app
