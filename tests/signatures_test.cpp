// SPDX-License-Identifier: Apache-2.0
// The C++ signature of a kernel against what its compiler saw. ocl::Kernel checks itself when it is made, so the tests
// of stages check all kernels; what is tested here is that the check sees a difference.
#include <gtest/gtest.h>

#include "egosgm/error.h"
#include "host/ocl/kernel.h"
#include "kernels/shared.h"
#include "tests/support/device.h"
#include "tests/support/expect_refused.h"

namespace egosgm {
namespace {

constexpr const char* kSource = R"(
typedef struct { int width, height; } ImageSize;
kernel void add(const ImageSize size, const uint count, global const float* in, global ushort* out) {
  out[0] = in[0] + size.width + count;
}
)";

class Signatures : public ::testing::Test {
 protected:
  ocl::Context context_{testing::any_device()};
  cl::Program program_{context_.get(), std::string(kSource)};

  void SetUp() override { program_.build({context_.device()}, "-cl-std=CL1.2 -cl-kernel-arg-info"); }
};

using Size = const shared::ImageSize;
using In = const ocl::Buffer<float>;
using Out = ocl::Buffer<cl_ushort>;

TEST_F(Signatures, AcceptsWhatWasCompiled) {
  EXPECT_NO_THROW((ocl::Kernel<Size, const cl_uint, In, Out>(program_, "add")));
  EXPECT_EQ(ocl::compiled_signature(cl::Kernel(program_, "add")),
            (std::vector<std::string>{"ImageSize", "uint", "const float*", "ushort*"}));
}

TEST_F(Signatures, RefusesOtherTypesAnotherConstAndAnotherCount) {
  EXPECT_THROW((ocl::Kernel<Size, const cl_int, In, Out>(program_, "add")), std::logic_error) << "int for uint";
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, const ocl::Buffer<cl_int>, Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In, ocl::Buffer<cl_short>>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<const shared::DisparityRange, const cl_uint, In, Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, ocl::Buffer<float>, Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In, const Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In>(program_, "add")), std::logic_error);
}

TEST_F(Signatures, AreThoseOfSourcesAlone) {
  const cl::Program::Binaries binaries = program_.getInfo<CL_PROGRAM_BINARIES>();
  cl::Program compiled(context_.get(), {context_.device()}, binaries);
  compiled.build({context_.device()}, "-cl-std=CL1.2 -cl-kernel-arg-info");
  EXPECT_NO_THROW((ocl::Kernel<Size, const cl_int, ocl::Buffer<cl_uchar>, Out>(compiled, "add")));
  if (ocl::compiled_signature(cl::Kernel(compiled, "add")).empty()) return;  // as some drivers tell nothing of binaries
  EXPECT_THROW((ocl::Kernel<Size, const cl_int, Out>(compiled, "add")), std::logic_error) << "another count";
}

// A kernel's own limit may lie below the device's: every launch that only guards its bounds takes what there is.
TEST(WorkGroups, AreHalvedToWhatAKernelAllows) {
  const auto halved = [](const cl::NDRange& local, std::size_t limit) {
    const cl::NDRange sides = ocl::halved_to(local, limit);
    return std::vector<std::size_t>(sides.get(), sides.get() + sides.dimensions());
  };
  EXPECT_EQ(halved({64, 1, 1}, 1024), (std::vector<std::size_t>{64, 1, 1}));
  EXPECT_EQ(halved({64, 1, 1}, 32), (std::vector<std::size_t>{32, 1, 1}));
  EXPECT_EQ(halved({64, 1, 1}, 1), (std::vector<std::size_t>{1, 1, 1}));
  EXPECT_EQ(halved({64, 2}, 100), (std::vector<std::size_t>{32, 2}));
  EXPECT_EQ(halved({3, 1, 1}, 2), (std::vector<std::size_t>{3, 1, 1})) << "refused by name then";
  EXPECT_EQ(halved(cl::NullRange, 1), (std::vector<std::size_t>{})) << "left to the driver";
}

TEST_F(Signatures, AKernelWithAWorkGroupOfItsOwnKeepsIt) {
  const std::size_t limit = context_.max_work_group_size();
  cl::Program program(context_.get(),
                      "kernel __attribute__((reqd_work_group_size(SIZE, 1, 1))) void fixed(global int* "
                      "out) { out[get_global_id(0)] = 1; }\n"
                      "kernel void free_to_choose(global int* out) { out[get_global_id(0)] = 1; }");
  program.build({context_.device()}, "-cl-std=CL1.2 -cl-kernel-arg-info -DSIZE=1");
  ocl::Buffer<cl_int> out(context_, 2 * limit);
  const ocl::Range too_large{cl::NDRange(2 * limit), cl::NDRange(2 * limit)};
  ocl::Kernel<ocl::Buffer<cl_int>> fixed(program, "fixed"), free_to_choose(program, "free_to_choose");
  EXPECT_THROW(fixed(context_, too_large, out), DeviceError);
  out.fill(context_, 0);
  free_to_choose(context_, too_large, out);
  context_.wait();
  EXPECT_EQ(out.read(context_), std::vector<cl_int>(2 * limit, 1));
}

TEST(CountsBits, OnThisMachinesCpuAlone) {
  EXPECT_TRUE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 PoCL HSTR: pthread-x86_64-pc-linux-gnu-skylake-avx512"));
  EXPECT_TRUE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 PoCL HSTR: cpu-x86_64-pc-linux-gnu-znver4"));
  EXPECT_FALSE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 PoCL HSTR: pocl-remote"));
  EXPECT_FALSE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 PoCL HSTR: pthread-aarch64-unknown-linux-gnu-cortex-a76"));
  EXPECT_FALSE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 PoCL HSTR: CUDA-sm_90"));
  EXPECT_FALSE(ocl::is_this_cpu_by_pocl("OpenCL 3.0 -x86_64-"));
}

TEST(Times, ThatADriverLeavesOutAreThoseOfTheNextStep) {
  using Times = ocl::Context::Times;
  const auto completed = [](Times answered) {
    const Times t = ocl::Context::completed(answered);
    return std::array{t.queued, t.submitted, t.started, t.ended};
  };
  EXPECT_EQ(completed({10, 20, 30, 40}), (std::array<std::int64_t, 4>{10, 20, 30, 40}));
  EXPECT_EQ(completed({0, 20, 30, 40}), (std::array<std::int64_t, 4>{20, 20, 30, 40}));
  EXPECT_EQ(completed({0, 0, 30, 40}), (std::array<std::int64_t, 4>{30, 30, 30, 40}));
  EXPECT_EQ(completed({25, 20, 30, 40}), (std::array<std::int64_t, 4>{20, 20, 30, 40}));
}

TEST(Defines, FloatsArriveUnchanged) {
  ocl::Context context(testing::any_device());
  for (const float value : {0.1f, 1e-30f, 3.14159274f, -7.0f}) {
    cl::Program program(context.get(), std::string("kernel void put(global float* out) { out[0] = VALUE; }"));
    program.build({context.device()},
                  ("-cl-std=CL1.2 -cl-kernel-arg-info" + ocl::Defines().set("VALUE", value).text()).c_str());
    ocl::Buffer<float> out(context, 1);
    ocl::Kernel<ocl::Buffer<float>> put(program, "put");
    put(context, {cl::NDRange(1), cl::NDRange(1)}, out);
    EXPECT_EQ(out.read(context).at(0), value);
  }
}

TEST(Buffer, LargerThanTheDeviceAllowsNamesTheLimit) {
  ocl::Context context(testing::any_device());
  context.enter("Census");
  const auto limit = context.device().getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  testing::expect_refused<DeviceError>(
      [&] { ocl::Buffer<std::uint8_t>(context, limit + 1); },
      {"Census: needs a buffer", std::to_string(limit >> 20) + " MiB", "fewer disparities"});
}

TEST(Programs, RefuseAMissingDefine) {
  ocl::Context context(testing::any_device());
  context.enter("SearchBand");
  const auto build = [&] {
    context.program("search_band.cl", ocl::Defines().set("PIXELS", 1));
    context.build();
  };
  const std::string log = testing::refusal_of<BuildError>(build);
  for (const char* part : {"SearchBand", "ROW_GROUP"}) EXPECT_NE(log.find(part), std::string::npos) << log;
}

}  // namespace
}  // namespace egosgm
