// SPDX-License-Identifier: Apache-2.0
#include "vision/picture_sheet.h"

#include <algorithm>
#include <cmath>

#include "egosgm/error.h"
#include "vision/drawing.h"

namespace egosgm::vision {
namespace {

constexpr int kCaptionHeight = 24;

cv::Mat scaled_to(const cv::Mat& picture, int cell_width) {
  if (picture.cols <= cell_width) return picture;
  const int height = std::max(1, static_cast<int>(std::lround(1.0 * picture.rows * cell_width / picture.cols)));
  return shrunk(picture, {cell_width, height});
}

cv::Mat with_caption(const CaptionedPicture& item, int cell_width) {
  const cv::Mat picture = scaled_to(item.picture, cell_width);
  const int top = item.caption.empty() ? 0 : kCaptionHeight;
  cv::Mat cell(picture.rows + top, picture.cols, CV_8UC3, cv::Scalar::all(0));
  picture.copyTo(cell(cv::Rect(0, top, picture.cols, picture.rows)));
  if (top > 0) draw_text(cell, item.caption, 4, kCaptionHeight - 5, 2);
  return cell;
}

}  // namespace

cv::Mat compose(const std::vector<CaptionedPicture>& pictures, int columns, int cell_width) {
  require_width(cell_width);
  if (pictures.empty() || columns < 1) throw InvalidArgument("compose: at least one picture and one column are needed");
  std::vector<cv::Mat> cells;
  for (const CaptionedPicture& item : pictures) {
    if (item.picture.empty() || item.picture.type() != CV_8UC3)
      throw InvalidArgument("compose: pictures must be CV_8UC3");
    cells.push_back(with_caption(item, cell_width));
  }
  constexpr int kGap = 4;
  const int used_columns = std::min(columns, static_cast<int>(cells.size()));
  int column_width = 0;
  for (const cv::Mat& cell : cells) column_width = std::max(column_width, cell.cols);
  const int width = used_columns * (column_width + kGap) - kGap;
  require_width(width);
  cv::Mat sheet;
  for (std::size_t begin = 0; begin < cells.size(); begin += static_cast<std::size_t>(used_columns)) {
    const std::size_t end = std::min(cells.size(), begin + static_cast<std::size_t>(used_columns));
    int height = 0;
    for (std::size_t i = begin; i < end; ++i) height = std::max(height, cells[i].rows);
    cv::Mat row(height + (begin > 0 ? kGap : 0), width, CV_8UC3, cv::Scalar::all(0));
    for (std::size_t i = begin; i < end; ++i) {
      const int left = static_cast<int>(i - begin) * (column_width + kGap);
      cells[i].copyTo(row(cv::Rect(left, row.rows - height, cells[i].cols, cells[i].rows)));
    }
    if (sheet.empty()) {
      sheet = row;
    } else {
      sheet.push_back(row);
    }
  }
  return sheet;
}

}  // namespace egosgm::vision
