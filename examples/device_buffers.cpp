// SPDX-License-Identifier: Apache-2.0
// Frames between a program's own kernels, on its own queue: one splits the picture of a side-by-side camera into the
// two views, the pipeline finds disparities, another one turns them into depth. Images go up once, depth comes down
// once. egosgm_example_device_buffers FOLDER: writes NNNNNN.pfm, depth in metres (infinity: none), into the working
// directory.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>
#include <algorithm>
#include <cstdio>

#include "egosgm/odometry.h"
#include "egosgm/opencl.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image.h"

namespace {

constexpr const char* kKernels = R"(
kernel void split(int width, int height, global const uchar* side_by_side, global uchar* pair) {
  const int x = get_global_id(0), y = get_global_id(1), view = get_global_id(2);
  pair[(view * height + y) * width + x] = side_by_side[(2 * y + view) * width + x];
}
kernel void to_depth(float focal_times_baseline, float doffs, float invalid, global const float* disparity,
                     global float* depth) {
  const float d = disparity[get_global_id(0)];
  depth[get_global_id(0)] = d > invalid && d + doffs > 0 ? focal_times_baseline / (d + doffs) : -1;
}
)";

}  // namespace

int main(int argc, char** argv) try {
  using namespace egosgm;
  if (argc != 2) return std::fprintf(stderr, "usage: egosgm_example_device_buffers FOLDER\n"), 2;
  const vision::StereoSequence sequence = vision::open_folder(argv[1]);
  const vision::Size size = vision::check_image_sizes(sequence);
  const Calibration& c = sequence.calibration;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;

  const cl::Context context(CL_DEVICE_TYPE_ALL);
  const cl::Device device = context.getInfo<CL_CONTEXT_DEVICES>().front();
  cl::CommandQueue queue(context, device);
  const cl::Program program(context, kKernels, /*build=*/true);
  cl::Kernel split(program, "split"), to_depth(program, "to_depth");
  const cl::Buffer side_by_side(context, CL_MEM_READ_ONLY, 2 * pixels), pair(context, CL_MEM_READ_WRITE, 2 * pixels),
      depth(context, CL_MEM_WRITE_ONLY, pixels * sizeof(float));

  DevicePipeline pipeline(queue(), c, size.width, size.height);
  StereoOdometry odometry(c);
  vision::Image picture(size.height, 2 * size.width, vision::kU8), depth_m(size, vision::kF32);
  for (const vision::StereoFrame& frame : sequence.frames) {
    const vision::StereoImages images = vision::read_images(frame);
    const auto motion = odometry.process(vision::image_view(images.left), vision::image_view(images.right)).motion;
    if (images.left.type != vision::kU8) throw std::runtime_error("give images of 8 bits");
    images.left.copy_to(picture.part(0, 0, size.width, size.height));
    images.right.copy_to(picture.part(size.width, 0, size.width, size.height));

    queue.enqueueWriteBuffer(side_by_side, CL_FALSE, 0, 2 * pixels, picture.data);
    split.setArg(0, size.width), split.setArg(1, size.height), split.setArg(2, side_by_side), split.setArg(3, pair);
    queue.enqueueNDRangeKernel(split, cl::NullRange, cl::NDRange(size.width, size.height, 2));
    const DeviceMaps maps = pipeline.enqueue({pair(), PixelType::kU8}, motion);
    to_depth.setArg(0, static_cast<float>(c.fx * c.baseline_m)), to_depth.setArg(1, static_cast<float>(c.doffs_px));
    to_depth.setArg(2, kInvalidDisparity), to_depth.setArg(3, sizeof(cl_mem), &maps.disparity),
        to_depth.setArg(4, depth);
    queue.enqueueNDRangeKernel(to_depth, cl::NullRange, cl::NDRange(pixels));
    queue.enqueueReadBuffer(depth, CL_TRUE, 0, pixels * sizeof(float), depth_m.data);  // the only wait

    float* const depths = depth_m.row<float>(0);
    std::replace_if(
        depths, depths + pixels, [](float z) { return z < 0; }, kInvalidDisparity);
    vision::write_disparity(frame.name + ".pfm", depth_m);
  }
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
