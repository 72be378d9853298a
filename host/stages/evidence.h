// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/census.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Evidence of both views' blocks of EGOSGM_COARSE x EGOSGM_COARSE pixels, in rows of EGOSGM_EVIDENCE_STRIDE(width).
struct BlockEvidence {
  ocl::Buffer<cl_int> evidence;  // how much better than chance a frame's images match, EGOSGM_EVIDENCE_UNITS a bit
  Map found;                     // disparity of the coarse match [px]

  BlockEvidence(ocl::Context& context, shared::ImageSize size);
};

/// Results of CoarseMatch for a frame.
struct CoarseView {
  const ocl::Buffer<cl_uchar>& images;  // both views, 16 bits
  const Map& disparity;                 // [coarse px]
};

/// Says how much better than chance the images of a frame match, whatever the band was; and what is published: what has
/// been confirmed. Source: the existence probability of target tracking (Musicki, Evans, Stankovic 1994) and the sums
/// of occupancy maps, with the Hamming distances of codes in place of likelihoods.
class Evidence {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  Evidence(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, int pixels = 0);

  /// Whether the method has it: it needs codes of 64 bits.
  static bool is_of(const MethodOptions& options);

  /// `codes`: of both views (Census), as Matcher lays them out. `coarse`: null where there is no coarse match.
  void operator()(const ocl::Buffer<cl_uint>& codes, const CoarseView* coarse, const Map& predicted,
                  const Map& measured, BlockEvidence& blocks, Views views);

  /// Writes the disparities that are confirmed. `tracked`: the views that have evidence of their own.
  void publish(const Map& disparity, const FlagMap& evidence, Map& confirmed, Views views, Views tracked);

 private:
  using Words = const ocl::Buffer<cl_uint>;
  using Sums = ocl::Buffer<shared::EvidenceSum>;

  ocl::Stage stage_;
  const shared::ImageSize coarse_;
  const float gate_px_;
  const cl_int padding_, coarse_padding_;
  Census coarse_census_;
  ocl::Buffer<cl_uint> coarse_codes_, alike_;
  Sums sums_;
  ocl::Kernel<const shared::ImageSize, const float, const cl_int, Words, const cl_int, const cl_int, Words, Words,
              const Map, const Map, Sums>
      compare_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const Map, Words, const Sums, ocl::Buffer<cl_int>,
              Map>
      gather_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const Map, const FlagMap, Map> publish_;
};

}  // namespace egosgm
