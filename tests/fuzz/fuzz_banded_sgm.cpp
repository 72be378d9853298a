// SPDX-License-Identifier: Apache-2.0
// Random codes, grey values and bands for BandedSgm, in both ways and in stripes, against the reference.
#include <memory>

#include "host/stages/banded_sgm.h"
#include "tests/fuzz/bytes.h"
#include "tests/fuzz/target.h"
#include "tests/reference/banded_sgm.h"
#include "tests/reference/census.h"
#include "tests/reference/step_penalties.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm::fuzz {
namespace {

/// A matcher with all that it reads.
struct Matcher {
  shared::ImageSize size;
  shared::DisparityRange range;
  BandedSgmOptions options;
  ocl::Context& context = testing::shared_context();
  BandedSgm sgm{context, size, range, options};
  ocl::Buffer<cl_uint> codes{context, code_words()};
  ocl::Buffer<cl_uchar> penalties{context, 8 * pixel_count(size)};
  SearchBands bands{context, size, range};
  StereoMaps measured{context, size};

  std::size_t code_words() const {
    const std::vector<std::uint64_t> none(pixel_count(size));
    return reference::padded_codes(size, none, none, BandedSgm::code_padding(range), options.cost).size();
  }
};

Matcher& matcher(int index) {
  static std::vector<std::unique_ptr<Matcher>> matchers = [] {
    std::vector<std::unique_ptr<Matcher>> all;
    const auto add = [&](shared::ImageSize size, shared::DisparityRange range, BandedSgmOptions options) {
      all.push_back(std::unique_ptr<Matcher>(new Matcher{size, range, options}));
    };
    add({17, 9}, {0, 37}, {.scheduling = Scheduling::kWavefront});
    add({17, 9}, {0, 37}, {.scheduling = Scheduling::kPaths});
    add({9, 17}, {-21, 64}, {.cost = MatchingCost::kCensus9x7, .scheduling = Scheduling::kWavefront});
    add({5, 30}, {-3, 16}, {.cost = MatchingCost::kSad3x3, .paths = 4, .scheduling = Scheduling::kWavefront});
    add({23, 4}, {0, 100}, {.paths = 4, .scheduling = Scheduling::kPaths});
    return all;
  }();
  return *matchers[static_cast<std::size_t>(index) % matchers.size()];
}

/// A band that SearchBand could give: one chunk or pairs of them from a lane on, of which a part can win. Only where
/// the range itself does not consist of such, the last one may reach beyond it.
shared::Band random_band(Bytes& bytes, shared::DisparityRange range) {
  const bool one = range.count <= EGOSGM_LANES || bytes.below(2) > 0;
  const int unit = (one ? 1 : 2) * EGOSGM_LANES, step = one ? 1 : EGOSGM_BAND_STEP;
  const bool whole = range.count % unit == 0;
  const int lanes = SearchBand::max_chunks(range) * EGOSGM_LANES, least = whole ? unit : 1;
  const int lane = bytes.below((range.count - least) / step + 1) * step;
  const int most = one ? 1 : whole ? (lanes - lane) / unit : (lanes - lane + unit - 1) / unit;
  shared::Band band{};
  band.origin = static_cast<cl_short>(range.min + lane);
  band.chunks = static_cast<cl_ushort>(one ? 1 : 2 + 2 * bytes.below(most));
  const int last_lane = std::min(range.min + range.count, band.origin + band.chunks * EGOSGM_LANES) - 1;
  band.first = static_cast<cl_short>(band.origin + bytes.below(last_lane - band.origin + 1));
  band.last = static_cast<cl_short>(band.first + bytes.below(last_lane - band.first + 1));
  return band;
}

}  // namespace

std::vector<std::string> seeds() { return random_seeds(32, 4000); }

void run(std::string_view input) {
  Bytes bytes(input);
  Matcher& m = matcher(bytes.below(5));
  const std::size_t pixels = pixel_count(m.size);
  std::vector<shared::Band> bands;
  std::vector<cl_uint> offsets;
  for (std::size_t i = 0; i < 2 * pixels; ++i) {
    const bool same = i > 0 && bytes.below(3) > 0;  // bands of neighbours are alike
    bands.push_back(same ? bands.back() : random_band(bytes, m.range));
    offsets.push_back(i % m.size.width == 0 ? 0 : offsets.back() + bands[i - 1].chunks);
  }
  std::mt19937_64 random(bytes.take<std::uint64_t>());  // what the bytes do not reach
  std::vector<std::uint64_t> codes[2];
  std::vector<std::uint16_t> grey;
  const std::uint64_t bits = m.options.cost == MatchingCost::kCensus9x7 ? (1ull << 62) - 1
                             : m.options.cost == MatchingCost::kSad3x3  ? 255
                                                                        : 0xffffffffu;
  for (auto& view : codes) {
    for (std::size_t i = 0; i < pixels; ++i) view.push_back(random() & bits & (random() | random()));
  }
  for (std::size_t i = 0; i < 2 * pixels; ++i) grey.push_back(random() & 255);

  const auto padded =
      reference::padded_codes(m.size, codes[0], codes[1], BandedSgm::code_padding(m.range), m.options.cost);
  m.codes.write(m.context, {padded.begin(), padded.end()});
  const auto steps = reference::step_penalties(m.size, grey, 8, m.options);
  m.penalties.write(m.context, {steps.begin(), steps.end()});
  m.bands.bands.write(m.context, bands);
  m.bands.cell_offsets.write(m.context, offsets);
  const int reads_off = random() & 1;
  const MatchInputs inputs{m.codes, m.penalties, m.bands};
  if (reads_off) m.sgm.prepare_reading_off();
  reads_off ? m.sgm.reading_off(inputs, m.measured) : m.sgm.match(inputs, m.measured, Views::kBoth);

  const testing::HostMaps expected = reference::banded_sgm(m.size, m.range, m.options, codes, grey, bands, reads_off);
  const testing::HostMaps actual = testing::download(m.context, m.measured);
  for (const auto& same : {testing::same_bits(actual.disparity, expected.disparity, m.size),
                           testing::same_bits(actual.variance, expected.variance, m.size)}) {
    if (!same) throw std::logic_error(same.message());
  }
}

}  // namespace egosgm::fuzz
