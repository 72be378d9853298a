// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "egosgm/error.h"
#include "egosgm/opencl.h"
#include "host/frame/frame_queue.h"
#include "host/ocl/errors.h"
#include "host/ocl/svm.h"

namespace egosgm {
namespace {

Device device_on(cl_command_queue queue, const std::string& programs) {
  if (!queue) throw InvalidArgument("DevicePipeline: no queue: give a cl_command_queue");
  return ocl::translated("DevicePipeline", [&] {
    const cl::CommandQueue kernels(queue, /*retainObject=*/true);
    if (kernels.getInfo<CL_QUEUE_PROPERTIES>() & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) {
      throw InvalidArgument("DevicePipeline: the queue runs out of order: give one that runs in order");
    }
    Device::Handle handle = Device::Handle::of(kernels.getInfo<CL_QUEUE_DEVICE>());
    handle.queue = kernels;
    const Device device(std::make_shared<const Device::Handle>(std::move(handle)));
    return programs.empty() ? device : device.with_programs(programs);
  });
}

FrameImages images_on(const ocl::Context& context, const DeviceImages& images, shared::ImageSize size) {
  if (!images.pixels == !images.svm_pixels) {
    throw InvalidArgument(images.pixels ? "enqueue: images as cl_mem and as pointer: give one of them"
                                        : "enqueue: no images: give a cl_mem, or a pointer of clSVMAlloc");
  }
  const std::size_t needed = 2 * pixel_count(size) * (images.type == PixelType::kU8 ? 1 : 2);
  if (images.svm_pixels) {
    const cl::Buffer buffer = ocl::buffer_in_svm(context.get(), context.device(), images.svm_pixels, needed);
    return {ocl::Buffer<cl_uchar>(buffer, needed), images.type};
  }
  const cl::Buffer buffer(images.pixels, /*retainObject=*/true);
  const std::size_t bytes = buffer.getInfo<CL_MEM_SIZE>();
  if (buffer.getInfo<CL_MEM_CONTEXT>()() != context.get()()) {
    throw InvalidArgument("enqueue: the images are in another context than the queue: create them in the queue's");
  }
  if (bytes < needed) {
    throw InvalidArgument("enqueue: the images' buffer has " + std::to_string(bytes) + " bytes, a pair needs " +
                          std::to_string(needed) + ": left image, then right image, without gaps");
  }
  return {ocl::Buffer<cl_uchar>(buffer, bytes), images.type};
}

}  // namespace

DevicePipeline::DevicePipeline(cl_command_queue queue, const Calibration& calibration, int width, int height,
                               const PipelineOptions& options, const std::string& programs)
    : pipeline_(calibration, width, height, options, device_on(queue, programs)) {
  Wanted with_dynamic = kOnDevice;
  with_dynamic.add(Output::kDynamic);
  ocl::translated("DevicePipeline", [&] { pipeline_.impl_->prepare(PixelType::kU8, with_dynamic); });
}

DeviceMaps DevicePipeline::enqueue(const DeviceImages& images, const std::optional<Motion>& motion, cl_event* done,
                                   bool wants_dynamic) {
  ocl::expect_own_process("enqueue");
  FrameQueue& frames = *pipeline_.impl_;
  if (pipeline_.under_way() > 0) {
    throw InvalidArgument("enqueue: a frame that was submitted is under way: collect it first");
  }
  if (motion) motion->validate();
  return ocl::translated(frames.context(), [&] {
    frames.context().enter("enqueue");
    return frames.enqueue(images_on(frames.context(), images, frames.size()), motion, done, wants_dynamic);
  });
}

}  // namespace egosgm
