// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/stages/maps.h"
#include "host/stages/search_band.h"

namespace egosgm {

/// Inputs of a match: codes and penalties (see BandedSgm), and the bands of SearchBand.
struct MatchInputs {
  const ocl::Buffer<cl_uint>& codes;
  const ocl::Buffer<cl_uchar>& penalties;
  const SearchBands& bands;
};

/// A horizontal stripe of an image: `rows` rows from `first_row` on are matched, those of [kept_begin, kept_end) kept.
struct Stripe {
  int first_row, rows, kept_begin, kept_end;
};

/// The least number of rows a stripe, at most `most_rows`, that needs no further stripe: more rows would be matched
/// twice. An even number of rows is left, so that all stripes begin with a row that the right view has.
int fewest_rows(int height, int most_rows, int overlap);

/// Stripes of `rows` matched rows each. Of every stripe, `overlap` rows at either end are not kept, except at the
/// image's edges. REQUIRES: rows > 2 * overlap + 1 and height - rows is even, or rows == height.
std::vector<Stripe> cut_into_stripes(int height, int rows, int overlap);

/// Memory for what a stripe's match reads and gives, laid out as if the stripe were the image.
class StripeMemory {
 public:
  /// `size`: of the image; `words_a_row`: of codes.
  StripeMemory(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int rows,
               std::size_t words_a_row);

  /// Brings a stripe of both views here.
  void load(const MatchInputs& image, const Stripe& stripe);
  /// Brings what is kept of the stripe's `measured` maps to the image's.
  void store(const Stripe& stripe, StereoMaps& image);

  MatchInputs inputs() const { return {codes_, penalties_, bands_}; }
  StereoMaps& measured() { return measured_; }

  /// The device memory that this takes.
  static std::uint64_t bytes(int width, int rows, std::size_t words_a_row);

 private:
  /// Rows of `planes` planes, each of `row` elements a row, from the image to here.
  template <typename T>
  void load_rows(const ocl::Buffer<T>& image, ocl::Buffer<T>& here, int planes, std::size_t row, int first_row);

  ocl::Context& context_;
  const shared::ImageSize size_, stripe_size_;
  const std::size_t words_a_row_;
  ocl::Buffer<cl_uint> codes_;
  ocl::Buffer<cl_uchar> penalties_;
  SearchBands bands_;
  StereoMaps measured_;
};

}  // namespace egosgm
