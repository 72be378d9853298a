// SPDX-License-Identifier: Apache-2.0
#include "host/stages/stripes.h"

#include <algorithm>

#include "host/stages/step_penalties.h"

namespace egosgm {
namespace {

constexpr int kViews = 2;

/// A stripe may begin a row earlier than its overlap asks for.
int stripe_count(int height, int rows, int overlap) {
  const int inner = rows - 2 * overlap - 1;
  return (height + inner - 1) / inner;
}

}  // namespace

int fewest_rows(int height, int most_rows, int overlap) {
  if (most_rows >= height) return height;
  const int most = most_rows - (height - most_rows) % 2, count = stripe_count(height, most, overlap);
  const int rows = std::min(most, (height + count - 1) / count + 2 * overlap + 1);
  return rows + (height - rows) % 2;
}

std::vector<Stripe> cut_into_stripes(int height, int rows, int overlap) {
  if (rows >= height) return {{0, height, 0, height}};
  const int count = stripe_count(height, rows, overlap);
  std::vector<Stripe> stripes;
  for (int i = 0; i < count; ++i) {
    // The stripes have about equal height, rather than a thin one at the end.
    const int begin = static_cast<int>(static_cast<std::int64_t>(height) * i / count);
    const int end = static_cast<int>(static_cast<std::int64_t>(height) * (i + 1) / count);
    const int first = std::clamp(begin - overlap, 0, height - rows);
    stripes.push_back({first - first % 2, rows, begin, end});
  }
  return stripes;
}

StripeMemory::StripeMemory(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int rows,
                           std::size_t words_a_row)
    : context_(context),
      size_(size),
      stripe_size_{size.width, rows},
      words_a_row_(words_a_row),
      codes_(context, kViews * words_a_row * rows),
      penalties_(context, StepPenalties::bytes(stripe_size_)),
      bands_(context, stripe_size_, range),
      measured_(context, stripe_size_) {}

std::uint64_t StripeMemory::bytes(int width, int rows, std::size_t words_a_row) {
  const std::uint64_t a_pixel =
      kViews * (StepPenalties::kStepsAPixel + sizeof(shared::Band) + sizeof(cl_uint) + 2 * sizeof(float));
  return rows * (kViews * words_a_row * sizeof(cl_uint) + width * a_pixel);
}

template <typename T>
void StripeMemory::load_rows(const ocl::Buffer<T>& image, ocl::Buffer<T>& here, int planes, std::size_t row,
                             int first_row) {
  const std::size_t count = row * stripe_size_.height;
  for (int plane = 0; plane < planes; ++plane) {
    here.copy(context_, plane * count, image, (static_cast<std::size_t>(plane) * size_.height + first_row) * row,
              count);
  }
}

void StripeMemory::load(const MatchInputs& image, const Stripe& stripe) {
  const std::size_t width = size_.width;
  load_rows(image.codes, codes_, kViews, words_a_row_, stripe.first_row);
  load_rows(image.penalties, penalties_, kViews, StepPenalties::kStepsAPixel * width, stripe.first_row);
  load_rows(image.bands.bands, bands_.bands, kViews, width, stripe.first_row);
  load_rows(image.bands.cell_offsets, bands_.cell_offsets, kViews, width, stripe.first_row);
  load_rows(image.bands.row_sums, bands_.row_sums, kViews, 1, stripe.first_row);
}

void StripeMemory::store(const Stripe& stripe, StereoMaps& image) {
  const std::size_t width = size_.width, count = (stripe.kept_end - stripe.kept_begin) * width;
  for (int view = 0; view < kViews; ++view) {
    const std::size_t to = (static_cast<std::size_t>(view) * size_.height + stripe.kept_begin) * width;
    const std::size_t from =
        (static_cast<std::size_t>(view) * stripe_size_.height + stripe.kept_begin - stripe.first_row) * width;
    image.disparity.copy(context_, to, measured_.disparity, from, count);
    image.variance.copy(context_, to, measured_.variance, from, count);
  }
}

}  // namespace egosgm
