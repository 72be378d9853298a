// SPDX-License-Identifier: Apache-2.0
#include "vision/picture_sheet.h"

#include <algorithm>
#include <cmath>

#include "egosgm/error.h"
#include "vision/drawing.h"

namespace egosgm::vision {
namespace {

constexpr int kCaptionHeight = 24;

Image scaled_to(const Image& picture, int cell_width) {
  if (picture.cols <= cell_width) return picture;
  const int height = std::max(1, static_cast<int>(std::lround(1.0 * picture.rows * cell_width / picture.cols)));
  return shrunk(picture, {cell_width, height});
}

Image with_caption(const CaptionedPicture& item, int cell_width) {
  const Image picture = scaled_to(item.picture, cell_width);
  const int top = item.caption.empty() ? 0 : kCaptionHeight;
  Image cell(picture.rows + top, picture.cols, kBgr8, 0);
  picture.copy_to(cell.part(0, top, picture.cols, picture.rows));
  if (top > 0) draw_text(cell, item.caption, 4, kCaptionHeight - 5, 2);
  return cell;
}

}  // namespace

Image compose(const std::vector<CaptionedPicture>& pictures, int columns, int cell_width) {
  require_width(cell_width);
  if (pictures.empty() || columns < 1) throw InvalidArgument("compose: at least one picture and one column are needed");
  std::vector<Image> cells;
  for (const CaptionedPicture& item : pictures) {
    if (item.picture.empty() || item.picture.type != kBgr8)
      throw InvalidArgument("compose: pictures must be BGR of uint8");
    cells.push_back(with_caption(item, cell_width));
  }
  constexpr int kGap = 4;
  const int used_columns = std::min(columns, static_cast<int>(cells.size()));
  int column_width = 0;
  for (const Image& cell : cells) column_width = std::max(column_width, cell.cols);
  const int width = used_columns * (column_width + kGap) - kGap;
  require_width(width);
  Image sheet;
  for (std::size_t begin = 0; begin < cells.size(); begin += static_cast<std::size_t>(used_columns)) {
    const std::size_t end = std::min(cells.size(), begin + static_cast<std::size_t>(used_columns));
    int height = 0;
    for (std::size_t i = begin; i < end; ++i) height = std::max(height, cells[i].rows);
    Image row(height + (begin > 0 ? kGap : 0), width, kBgr8, 0);
    for (std::size_t i = begin; i < end; ++i) {
      const int left = static_cast<int>(i - begin) * (column_width + kGap);
      cells[i].copy_to(row.part(left, row.rows - height, cells[i].cols, cells[i].rows));
    }
    sheet = stacked(sheet, row);
  }
  return sheet;
}

}  // namespace egosgm::vision
