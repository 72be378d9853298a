// SPDX-License-Identifier: Apache-2.0
#include "host/stages/matcher.h"

namespace egosgm {

Matcher::Matcher(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                 const BandedSgmOptions& options, const Sizes& sizes)
    : census_([=, &context](PixelType type) {
        return Census(context, size, type, options.cost, BandedSgm::code_padding(range), 0, sizes.tile.code_words);
      }),
      step_penalties_([=, &context](PixelType type) { return StepPenalties(context, size, type, options); }),
      banded_sgm_(context, size, range, options, sizes.group, sizes.tile),
      codes_(context, Census::words(options.cost, size, BandedSgm::code_padding(range), sizes.tile.code_words)),
      penalties_(context, StepPenalties::bytes(size)) {}

void Matcher::prepare(PixelType type) {
  census_.prepare(type);
  step_penalties_.prepare(type);
}

void Matcher::match(const FrameImages& images, const SearchBands& bands, StereoMaps& matched, Views views,
                    cl_int coded) {
  banded_sgm_.match(inputs(images, bands, views, coded), matched, views);
}

void Matcher::reading_off(const FrameImages& images, const SearchBands& bands, StereoMaps& matched, Views views,
                          cl_int coded) {
  banded_sgm_.reading_off(inputs(images, bands, views, coded), matched, views);
}

MatchInputs Matcher::inputs(const FrameImages& images, const SearchBands& bands, Views views, cl_int coded) {
  census_[images.type].encode(images.pixels, codes_, coded);
  step_penalties_[images.type].compute(images.pixels, penalties_, views);
  return {codes_, penalties_, bands};
}

}  // namespace egosgm
