// SPDX-License-Identifier: Apache-2.0
// The C++ signature of a kernel against what its compiler saw. ocl::Kernel checks itself when it is made, so every test
// of a stage, and the pipelines here, check all kernels; what is tested here is that the check sees a difference.
#include <gtest/gtest.h>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/ocl/kernel.h"
#include "kernels/shared.h"
#include "tests/support/device.h"

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

TEST_F(Signatures, RefusesOtherTypes) {
  EXPECT_THROW((ocl::Kernel<Size, const cl_int, In, Out>(program_, "add")), std::logic_error) << "int for uint";
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, const ocl::Buffer<cl_int>, Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In, ocl::Buffer<cl_short>>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<const shared::DisparityRange, const cl_uint, In, Out>(program_, "add")), std::logic_error);
}

TEST_F(Signatures, RefusesAnotherConst) {
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, ocl::Buffer<float>, Out>(program_, "add")), std::logic_error);
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In, const Out>(program_, "add")), std::logic_error);
}

TEST_F(Signatures, RefusesAnotherCount) {
  EXPECT_THROW((ocl::Kernel<Size, const cl_uint, In>(program_, "add")), std::logic_error);
}

TEST(AllKernels, HaveTheSignatureThatTheirStagesDeclare) {
  for (const MatchingCost cost : {MatchingCost::kCensus9x7, MatchingCost::kSad3x3}) {
    PipelineOptions options;
    options.disparities = 16;
    options.banded_sgm.cost = cost;
    EXPECT_NO_THROW(Pipeline({.fx = 20, .fy = 20, .cx = 8, .cy = 4, .baseline_m = 0.5}, 16, 8, options));
  }
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
  try {
    ocl::Buffer<std::uint8_t>(context, limit + 1);
    FAIL() << "made a buffer of " << limit + 1 << " bytes";
  } catch (const DeviceError& error) {
    EXPECT_EQ(error.code(), CL_MEM_OBJECT_ALLOCATION_FAILURE);
    for (const std::string& part : {std::string("Census: needs a buffer"), std::to_string(limit >> 20) + " MiB",
                                    std::string("fewer disparities")}) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
}

TEST(Programs, RefuseAMissingDefine) {
  ocl::Context context(testing::any_device());
  context.enter("SearchBand");
  try {
    context.program("search_band.cl", {});
    FAIL() << "built without ROW_GROUP";
  } catch (const BuildError& error) {
    EXPECT_NE(std::string(error.what()).find("SearchBand"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("ROW_GROUP"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace egosgm
