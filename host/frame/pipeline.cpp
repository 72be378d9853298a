// SPDX-License-Identifier: Apache-2.0
#include "egosgm/pipeline.h"

#include <string>
#include <tuple>

#include "egosgm/error.h"
#include "host/frame/check_frame.h"
#include "host/frame/frame_queue.h"
#include "host/ocl/errors.h"

namespace egosgm {

const char* to_string(std::optional<Unpredicted> why_not) {
  if (!why_not) return "";
  switch (*why_not) {
    case Unpredicted::kFirstFrame:
      return "first frame";
    case Unpredicted::kReset:
      return "reset";
    case Unpredicted::kNoMotion:
      return "no motion";
    case Unpredicted::kNotTemporal:
      return "not temporal";
  }
  return "";
}

Pipeline::Pipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options,
                   const Device& device, PixelType type) {
  calibration.validate();
  options.validate();
  check_size(width, height);
  impl_ = ocl::translated("Pipeline", [&] {
    return std::make_unique<Impl>(calibration, shared::ImageSize{width, height}, options, device, type);
  });
}

Pipeline::~Pipeline() {
  if (ocl::is_forked()) std::ignore = impl_.release();  // nothing can be given back to a driver without its threads
}
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

void Pipeline::prepare(PixelType type, const FrameOutputs& outputs) {
  ocl::expect_own_process("prepare");
  if (under_way() > 0) throw InvalidArgument("prepare: a frame that was submitted is under way: collect it first");
  ocl::translated(impl_->context(), [&] { impl_->prepare(type, wanted_of(outputs)); });
}

FrameReport Pipeline::process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                              const FrameOutputs& outputs) {
  ocl::expect_own_process("process");
  if (under_way() > 0) throw InvalidArgument("process: a frame that was submitted is under way: collect it first");
  submit(left, right, motion, outputs);
  return collect();
}

void Pipeline::submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                      const FrameOutputs& outputs) {
  ocl::expect_own_process("submit");
  if (under_way() == kMaxUnderWay) {
    throw InvalidArgument("submit: " + std::to_string(kMaxUnderWay) + " frames are under way: collect one first");
  }
  check_frame(impl_->size(), left, right, outputs);
  if (motion) motion->validate();
  ocl::translated(impl_->context(), [&] { impl_->submit(left, right, motion, outputs); });
}

FrameReport Pipeline::collect() {
  ocl::expect_own_process("collect");
  if (under_way() == 0) throw InvalidArgument("collect: no frame is under way: submit one first");
  return ocl::translated(impl_->context(), [&] { return impl_->collect(); });
}

int Pipeline::under_way() const { return impl_->under_way(); }
void Pipeline::reset() { impl_->reset(); }
void Pipeline::record_commands(bool wanted) { impl_->record_commands(wanted); }
const PipelineOptions& Pipeline::options() const { return impl_->options(); }
const Device& Pipeline::device() const { return impl_->device(); }
std::uint64_t Pipeline::device_memory_bytes() const { return impl_->context().allocated_bytes(); }

}  // namespace egosgm
