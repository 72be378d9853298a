// SPDX-License-Identifier: Apache-2.0
#include "host/pair_hash.h"

#include <cstring>

#include "host/cpu_clones.h"

namespace egosgm {
namespace {

constexpr std::size_t kLanes = PairHash{}.size();

/// A step has an inverse, so that no word is lost.
inline void add_step(const char* pixels, std::size_t bytes, std::uint32_t* hash) {
  std::uint32_t words[kLanes] = {};
  std::memcpy(words, pixels, bytes);
  for (std::size_t i = 0; i < kLanes; ++i) {
    const std::uint32_t product = (hash[i] ^ words[i]) * 0x9E3779B1u;
    hash[i] = product ^ (product >> 15);
  }
}

EGOSGM_CPU_CLONES void add_row(const char* row, std::size_t bytes, std::uint32_t* hash) {
  constexpr std::size_t kStep = kLanes * sizeof(std::uint32_t);
  for (; bytes >= kStep; row += kStep, bytes -= kStep) add_step(row, kStep, hash);
  add_step(row, bytes, hash);
}

}  // namespace

PairHash hash_of(const ImageView& left, const ImageView& right) {
  PairHash hash{};
  hash.fill(1);  // so that a zero changes it
  for (const ImageView* view : {&left, &right}) {
    const std::size_t bytes = static_cast<std::size_t>(view->width) * (view->type == PixelType::kU8 ? 1 : 2);
    for (int y = 0; y < view->height; ++y) {
      add_row(static_cast<const char*>(view->data) + y * view->stride_bytes, bytes, hash.data());
    }
  }
  return hash;
}

}  // namespace egosgm
